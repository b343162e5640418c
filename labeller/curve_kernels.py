"""The compiled part of `labeller.curves`: lists to errors, and lists to colours, in float64.

Errors are made for blocks of pixels whose entries (one for each k that can have an error) lie one after the other.
What runs along a list (the core front to back, the tail's sums back to front) is scalar; all that an entry needs by
itself (weights, division, encoding: most of the work) is SIMD code over the whole block, however short the lists are.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from labeller.numerics import add_squared, display_of, tail_weights
from renderer.depth_bins import BinForm, Kept, binned_exponents, kept_room, place_of
from schemas.tail import MAX_EXPONENT, TailKind

_DENSITY: Final = int(TailKind.DENSITY)
_WEIGHTED_AVERAGE: Final = int(TailKind.WEIGHTED_AVERAGE)
_PAPER: Final = int(TailKind.PAPER)
DISPLAY: Final = 0
_BLOCK: Final = 2048  # entries: what is in work then fits in the second-level cache
_ROUNDING: Final = 1e-24  # squared differences below this are the rounding of float64 sums: the pixel is exact


class Lists(NamedTuple):
    """A dump, where each pixel's depth bins lie (or nothing), and the chunks of pixels that threads take."""

    offsets: NDArray[np.int64]
    rgba: NDArray[np.uint8]
    depth: NDArray[np.float32]
    background: NDArray[np.uint8]
    nearest: NDArray[np.float32]
    extent: NDArray[np.float32]
    chunks: NDArray[np.int64]


class Look(NamedTuple):
    """How lists become colours: a tail's kind and depth bins, metric, and tables of the 256 stored values.

    Compiled loops take no tuple in a tuple: the form of the bins is taken apart.
    """

    tail: int
    bins: int
    share_levels: int
    mean_levels: int
    space: int
    decode: NDArray[np.float64]
    level: NDArray[np.float64]
    optical: NDArray[np.float64]


@njit(inline="always")
def _form(look: Look) -> BinForm:
    return BinForm(look.bins, look.share_levels, look.mean_levels)


class _Block(NamedTuple):
    """Entries of consecutive pixels, float64 [M]; the entry `at + m` of a pixel that begins at `at` stands for k = m.

    Attributes:
        alpha: Of fragment m.
        red: Of fragment m, decoded; so are `green` and `blue`.
        exponent: D times the relative depth of fragment m, or what its depth bins say is in front of it.
        base_red: Core plus background behind the tail; so are the others.
        exact_red: The pixel's exact colour, encoded; so are the others.
        share: What the mean colour of the tail is multiplied with.
        weight: Of fragment m in the tail.
        factor: Sums of the weights from fragment m on, then the share divided by them.
        sum_red: Weighted colour sums from fragment m on; so are the others.
        squared: Squared difference from the exact colour.
    """

    alpha: NDArray[np.float64]
    red: NDArray[np.float64]
    green: NDArray[np.float64]
    blue: NDArray[np.float64]
    exponent: NDArray[np.float64]
    base_red: NDArray[np.float64]
    base_green: NDArray[np.float64]
    base_blue: NDArray[np.float64]
    exact_red: NDArray[np.float64]
    exact_green: NDArray[np.float64]
    exact_blue: NDArray[np.float64]
    share: NDArray[np.float64]
    weight: NDArray[np.float64]
    factor: NDArray[np.float64]
    sum_red: NDArray[np.float64]
    sum_green: NDArray[np.float64]
    sum_blue: NDArray[np.float64]
    squared: NDArray[np.float64]


@njit(cache=True)
def _block(room: int) -> _Block:
    return _Block(
        *(np.empty(room), np.empty(room), np.empty(room), np.empty(room), np.empty(room), np.empty(room)),
        *(np.empty(room), np.empty(room), np.empty(room), np.empty(room), np.empty(room), np.empty(room)),
        *(np.empty(room), np.empty(room), np.empty(room), np.empty(room), np.empty(room), np.empty(room)),
    )


@njit(parallel=True, cache=True, error_model="numpy")
def errors_of(
    lists: Lists, look: Look, gs: NDArray[np.float64], weights: NDArray[np.float64], error: NDArray[np.float32]
) -> None:
    """Squared differences from the exact colour, for every k, every pixel and every g.

    Args:
        lists: The view.
        look: Tail and metric.
        gs: float64 [G], steepnesses of the density tail; [0] for the other tails.
        weights: float64 [P], what the errors of a pixel are multiplied with, or [0]: nothing.
        error: float32 [G, N+P].
    """
    offsets = lists.offsets
    # The last fragment alone in a tail shows what it is: no error, but for the tail that has no opacity factor.
    lossless = 1 if look.tail == _PAPER else 2
    for chunk in prange(len(lists.chunks) - 1):
        first, end = lists.chunks[chunk], lists.chunks[chunk + 1]
        longest = 0
        for p in range(first, end):
            longest = max(longest, offsets[p + 1] - offsets[p])
        room = max(_BLOCK, longest)
        block, counts, kept = _block(room), np.empty(room, dtype=np.int64), kept_room()
        while first < end:
            last, used = first, 0
            while last < end and last - first < room:
                n = offsets[last + 1] - offsets[last]
                entries = n if n >= lossless else 0
                if used + entries > room:
                    break
                counts[last - first] = entries
                used += entries
                last += 1
            _gather(lists, look, first, counts[: last - first], kept, block)
            for j in range(len(gs)):
                _mix(look, gs[j], counts[: last - first], used, block)
                _store(offsets, first, counts[: last - first], weights, block.squared, error[j])
            first = last


@njit(cache=True, error_model="numpy")
def _gather(lists: Lists, look: Look, first: int, counts: NDArray[np.int64], kept: Kept, block: _Block) -> None:
    """Everything of the pixels' entries that does not depend on g."""
    at = 0
    for j in range(len(counts)):
        n = counts[j]
        if n == 0:
            continue
        p = first + j
        begin = lists.offsets[p]
        rgba, depth = lists.rgba[begin : begin + n], lists.depth[begin : begin + n]
        optical = _core(look, rgba, lists.background[p], at, block)
        if look.bins:
            exponent = block.exponent[at : at + n]
            binned_exponents(_form(look), depth, rgba, lists.nearest[p], lists.extent[p], kept, exponent)
            at += n
            continue
        near = np.float64(depth[0])
        for i in range(n):
            block.exponent[np.uint64(at + i)] = np.float64(depth[np.uint64(i)]) - near
        extent = block.exponent[at + n - 1]
        steepness = optical / extent if extent > 0.0 else 0.0
        for i in range(n):
            block.exponent[np.uint64(at + i)] *= steepness
        at += n


@njit(inline="always")
def _core(look: Look, rgba: NDArray[np.uint8], background: NDArray[np.uint8], at: int, block: _Block) -> float:
    """Core and background of a pixel's entries, front to back and back again; the pixel's optical depth."""
    n = len(rgba)
    red, green, blue = 0.0, 0.0, 0.0
    through, optical = 1.0, 0.0
    for m in range(n):
        i, j = np.uint64(at + m), np.uint64(m)
        alpha = look.level[rgba[j, 3]]
        r, g, b = look.decode[rgba[j, 0]], look.decode[rgba[j, 1]], look.decode[rgba[j, 2]]
        block.alpha[i], block.red[i], block.green[i], block.blue[i] = alpha, r, g, b
        block.base_red[i], block.base_green[i], block.base_blue[i], block.share[i] = red, green, blue, through
        visible = through * alpha
        red += visible * r
        green += visible * g
        blue += visible * b
        through *= 1.0 - alpha
        optical += look.optical[rgba[j, 3]]
    r, g, b = look.decode[background[0]], look.decode[background[1]], look.decode[background[2]]
    red, green, blue = red + through * r, green + through * g, blue + through * b
    if look.space == DISPLAY:
        red, green, blue = display_of(red), display_of(green), display_of(blue)
    through, alphas = 1.0, 0.0
    for m in range(n):
        i = np.uint64(at + n - 1 - m)
        through *= 1.0 - block.alpha[i]
        alphas += block.alpha[i]
        opacity, behind = tail_factors(look.tail, m + 1, alphas, through)
        light = block.share[i] * behind
        block.base_red[i] += light * r
        block.base_green[i] += light * g
        block.base_blue[i] += light * b
        block.share[i] *= opacity
        block.exact_red[i], block.exact_green[i], block.exact_blue[i] = red, green, blue
    return optical


@njit(inline="always")
def tail_factors(tail: int, count: int, alphas: float, through: float) -> tuple[float, float]:
    """What a tail's mean colour, and the background, are multiplied with.

    Args:
        tail: `schemas.tail.TailKind`.
        count: Fragments of the tail.
        alphas: Sum of their alphas.
        through: Product of their `1 - alpha`.
    """
    if alphas <= 0.0:
        return 0.0, 1.0
    if tail in (_WEIGHTED_AVERAGE, _PAPER):
        through = max(1.0 - alphas / count, 0.0) ** count
    return (1.0 if tail == _PAPER else 1.0 - through), through


@njit(cache=True, error_model="numpy")
def _mix(look: Look, g: float, counts: NDArray[np.int64], used: int, block: _Block) -> None:
    """Squared differences of all entries."""
    weight = block.alpha
    if look.bins or (look.tail == _DENSITY and g > 0.0):
        weight = block.weight
        tail_weights(block.alpha[:used], block.exponent[:used], 1.0 if look.bins else g, weight[:used])
    at = 0
    for n in counts:
        red, green, blue, total = 0.0, 0.0, 0.0, 0.0
        for m in range(n):
            i = np.uint64(at + n - 1 - m)
            w = weight[i]
            total += w
            red += w * block.red[i]
            green += w * block.green[i]
            blue += w * block.blue[i]
            block.sum_red[i], block.sum_green[i], block.sum_blue[i], block.factor[i] = red, green, blue, total
        at += n
    factor, squared = block.factor[:used], block.squared[:used]
    _divide(block.share[:used], factor)
    squared[:] = 0.0
    display = look.space == DISPLAY
    add_squared(block.base_red[:used], factor, block.sum_red[:used], block.exact_red[:used], display, squared)
    add_squared(block.base_green[:used], factor, block.sum_green[:used], block.exact_green[:used], display, squared)
    add_squared(block.base_blue[:used], factor, block.sum_blue[:used], block.exact_blue[:used], display, squared)


@njit(cache=True, error_model="numpy")
def _divide(share: NDArray[np.float64], factor: NDArray[np.float64]) -> None:
    for i in range(len(factor)):
        factor[i] = share[i] / (factor[i] if factor[i] > 0.0 else 1.0)


@njit(cache=True, error_model="numpy")
def _store(
    offsets: NDArray[np.int64],
    first: int,
    counts: NDArray[np.int64],
    weights: NDArray[np.float64],
    squared: NDArray[np.float64],
    error: NDArray[np.float32],
) -> None:
    at = 0
    for j in range(len(counts)):
        p = first + j
        scale = weights[p] if len(weights) else 1.0
        begin, n = offsets[p] + p, counts[j]
        for m in range(n):
            value = squared[np.uint64(at + m)]
            error[np.uint64(begin + m)] = value * scale if value > _ROUNDING else 0.0
        for k in range(begin + n, offsets[p + 1] + p + 1):
            error[k] = 0.0
        at += n


@njit(parallel=True, cache=True, error_model="numpy")
def colours_of(lists: Lists, look: Look, g: float, kept: NDArray[np.int32], out: NDArray[np.float32]) -> None:
    """Linear colours of an allocation, one list at a time.

    Args:
        lists: The view.
        look: Tail; the metric is linear.
        g: Steepness of the density tail.
        kept: int32 [P], 0 <= k <= n.
        out: float32 [P, 3].
    """
    offsets, decode, level = lists.offsets, look.decode, look.level
    for chunk in prange(len(lists.chunks) - 1):
        core, sums, kept_bins = np.empty(3), np.empty(3), kept_room()
        exponents = np.empty(0)
        for p in range(lists.chunks[chunk], lists.chunks[chunk + 1]):
            n, k = offsets[p + 1] - offsets[p], kept[p]
            rgba = lists.rgba[offsets[p] : offsets[p + 1]]
            core[:], t = 0.0, 1.0
            for i in range(k):
                for c in range(3):
                    core[c] += t * level[rgba[i, 3]] * decode[rgba[i, c]]
                t *= 1.0 - level[rgba[i, 3]]
            sums[:], alphas, total, through = 0.0, 0.0, 0.0, 1.0
            if len(exponents) < n:
                exponents = np.empty(2 * n)
            if k < n:
                _exponents(lists, look, g, p, kept_bins, exponents[:n])
            for i in range(n - 1, k - 1, -1):
                alpha = level[rgba[i, 3]]
                w = alpha * math.exp(-min(exponents[i], MAX_EXPONENT))
                alphas += alpha
                total += w
                through *= 1.0 - alpha
                for c in range(3):
                    sums[c] += w * decode[rgba[i, c]]
            opacity, behind = tail_factors(look.tail, n - k, alphas, through)
            share = opacity / total if total > 0.0 else 0.0
            for c in range(3):
                out[p, c] = core[c] + t * (share * sums[c] + behind * decode[lists.background[p, c]])


@njit(inline="always")
def _exponents(lists: Lists, look: Look, g: float, p: int, kept: Kept, out: NDArray[np.float64]) -> None:
    """What `exp(-.)` of is a fragment's weight in the tail, float64 [n]."""
    if not look.bins and look.tail != _DENSITY:
        out[:] = 0.0
        return
    first, last = lists.offsets[p], lists.offsets[p + 1]
    rgba, depth = lists.rgba[first:last], lists.depth[first:last]
    if look.bins:
        binned_exponents(_form(look), depth, rgba, lists.nearest[p], lists.extent[p], kept, out)
        return
    total = 0.0
    for i in range(len(rgba)):
        total += look.optical[rgba[i, 3]]
    extent = np.float64(depth[-1]) - np.float64(depth[0])
    steepness = g * total / extent if extent > 0.0 else 0.0
    for i in range(len(out)):
        out[i] = steepness * (np.float64(depth[i]) - np.float64(depth[0]))


@njit(parallel=True, cache=True, error_model="numpy")
def leave_cuts(lists: Lists, bins: int, other: np.float32, error: NDArray[np.float32]) -> None:
    """Give every k that ends within a depth bin another error.

    Args:
        lists: The view.
        bins: Of its tail.
        other: The error.
        error: float32 [N+P], changed.
    """
    offsets, depth = lists.offsets, lists.depth
    for p in prange(len(offsets) - 1):
        before = -1
        for i in range(offsets[p], offsets[p + 1]):
            place = place_of(depth[np.uint64(i)], lists.nearest[p], lists.extent[p], bins)
            own = min(int(place), bins - 1)
            if own == before:
                error[i + p] = other
            before = own
