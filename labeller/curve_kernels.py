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

from labeller.numerics import tail_weights, to_display
from schemas.tail import MAX_EXPONENT

DENSITY: Final = 0
WEIGHTED_AVERAGE: Final = 2
PAPER: Final = 3
DISPLAY: Final = 0
_BLOCK: Final = 2048  # entries: what is in work then fits in the second-level cache
_ROUNDING: Final = 1e-24  # squared differences below this are the rounding of float64 sums: the pixel is exact


class Lists(NamedTuple):
    """A dump, and the chunks of pixels that threads take."""

    offsets: NDArray[np.int64]
    rgba: NDArray[np.uint8]
    depth: NDArray[np.float32]
    background: NDArray[np.uint8]
    chunks: NDArray[np.int64]


class Look(NamedTuple):
    """How lists become colours: tail, metric, and tables of the 256 stored values."""

    tail: int
    space: int
    decode: NDArray[np.float64]
    level: NDArray[np.float64]
    optical: NDArray[np.float64]


class _Block(NamedTuple):
    """Entries of consecutive pixels; entry `m` of a pixel stands for k = m.

    Attributes:
        alpha: float64 [M].
        colour: float64 [3, M], decoded.
        exponent: float64 [M], D times the relative depth.
        base: float64 [3, M], core plus background behind the tail.
        share: float64 [M], what the mean colour of the tail is multiplied with.
        weight: float64 [M], of the fragment in the tail.
        sums: float64 [M], of the weights from the fragment on.
        mixed: float64 [3, M], colour sums from the fragment on, then the colours and their display values.
        exact: float64 [3, M], by pixel of the block.
    """

    alpha: NDArray[np.float64]
    colour: NDArray[np.float64]
    exponent: NDArray[np.float64]
    base: NDArray[np.float64]
    share: NDArray[np.float64]
    weight: NDArray[np.float64]
    sums: NDArray[np.float64]
    mixed: NDArray[np.float64]
    exact: NDArray[np.float64]


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
    lossless = 1 if look.tail == PAPER else 2
    for chunk in prange(len(lists.chunks) - 1):
        first, end = lists.chunks[chunk], lists.chunks[chunk + 1]
        longest = 0
        for p in range(first, end):
            longest = max(longest, offsets[p + 1] - offsets[p])
        room = max(_BLOCK, longest)
        block = _Block(
            np.empty(room),
            np.empty((3, room)),
            np.empty(room),
            np.empty((3, room)),
            np.empty(room),
            np.empty(room),
            np.empty(room),
            np.empty((3, room)),
            np.empty((3, room)),
        )
        counts = np.empty(room, dtype=np.int64)
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
            _gather(lists, look, first, last, counts, block)
            for j in range(len(gs)):
                _mix(look, gs[j], counts[: last - first], used, block)
                _compare(lists.offsets, first, counts[: last - first], weights, block, error[j])
            first = last


@njit(cache=True, error_model="numpy")
def _gather(lists: Lists, look: Look, first: int, last: int, counts: NDArray[np.int64], block: _Block) -> None:
    """Everything of the pixels' entries that does not depend on g."""
    at = 0
    for p in range(first, last):
        if counts[p - first]:
            begin, after = lists.offsets[p], lists.offsets[p + 1]
            _core(look, lists.rgba[begin:after], lists.depth[begin:after], lists.background[p], p - first, at, block)
            at += after - begin
    if look.space == DISPLAY:
        for c in range(3):
            to_display(block.exact[c, : last - first])


@njit(cache=True, error_model="numpy")
def _core(
    look: Look,
    rgba: NDArray[np.uint8],
    depth: NDArray[np.float32],
    background: NDArray[np.uint8],
    pixel: int,
    at: int,
    block: _Block,
) -> None:
    n = len(rgba)
    red, green, blue = 0.0, 0.0, 0.0
    through, optical = 1.0, 0.0
    for i in range(n):
        alpha = look.level[rgba[i, 3]]
        r, g, b = look.decode[rgba[i, 0]], look.decode[rgba[i, 1]], look.decode[rgba[i, 2]]
        block.alpha[at + i] = alpha
        block.colour[0, at + i], block.colour[1, at + i], block.colour[2, at + i] = r, g, b
        block.base[0, at + i], block.base[1, at + i], block.base[2, at + i] = red, green, blue
        block.share[at + i] = through
        visible = through * alpha
        red += visible * r
        green += visible * g
        blue += visible * b
        through *= 1.0 - alpha
        optical += look.optical[rgba[i, 3]]
    r, g, b = look.decode[background[0]], look.decode[background[1]], look.decode[background[2]]
    block.exact[0, pixel], block.exact[1, pixel] = red + through * r, green + through * g
    block.exact[2, pixel] = blue + through * b
    near = np.float64(depth[0])
    extent = np.float64(depth[n - 1]) - near
    steepness = optical / extent if extent > 0.0 else 0.0
    through, alphas = 1.0, 0.0
    for i in range(n - 1, -1, -1):
        through *= 1.0 - block.alpha[at + i]
        alphas += block.alpha[at + i]
        opacity, behind = tail_factors(look.tail, n - i, alphas, through)
        block.exponent[at + i] = steepness * (np.float64(depth[i]) - near)
        light = block.share[at + i] * behind
        block.base[0, at + i] += light * r
        block.base[1, at + i] += light * g
        block.base[2, at + i] += light * b
        block.share[at + i] *= opacity


@njit(inline="always")
def tail_factors(tail: int, count: int, alphas: float, through: float) -> tuple[float, float]:
    """What a tail's mean colour, and the background, are multiplied with.

    Args:
        tail: Index in `schemas.tail.TAILS`.
        count: Fragments of the tail.
        alphas: Sum of their alphas.
        through: Product of their `1 - alpha`.
    """
    if alphas <= 0.0:
        return 0.0, 1.0
    if tail in (WEIGHTED_AVERAGE, PAPER):
        through = max(1.0 - alphas / count, 0.0) ** count
    return (1.0 if tail == PAPER else 1.0 - through), through


@njit(cache=True, error_model="numpy")
def _mix(look: Look, g: float, counts: NDArray[np.int64], used: int, block: _Block) -> None:
    """The colours of all entries, encoded."""
    weight = block.alpha
    if look.tail == DENSITY and g > 0.0:
        weight = block.weight
        tail_weights(block.alpha[:used], block.exponent[:used], g, weight[:used])
    at = 0
    for n in counts:
        red, green, blue, total = 0.0, 0.0, 0.0, 0.0
        for i in range(at + n - 1, at - 1, -1):
            w = weight[i]
            total += w
            red += w * block.colour[0, i]
            green += w * block.colour[1, i]
            blue += w * block.colour[2, i]
            block.mixed[0, i], block.mixed[1, i], block.mixed[2, i] = red, green, blue
            block.sums[i] = total
        at += n
    _divide(block.share[:used], block.sums[:used])
    for c in range(3):
        _add(block.base[c, :used], block.sums[:used], block.mixed[c, :used])
        if look.space == DISPLAY:
            to_display(block.mixed[c, :used])


@njit(cache=True, error_model="numpy")
def _divide(share: NDArray[np.float64], sums: NDArray[np.float64]) -> None:
    for i in range(len(sums)):
        sums[i] = share[i] / (sums[i] if sums[i] > 0.0 else 1.0)


@njit(cache=True, error_model="numpy")
def _add(base: NDArray[np.float64], factor: NDArray[np.float64], mixed: NDArray[np.float64]) -> None:
    for i in range(len(mixed)):
        mixed[i] = base[i] + factor[i] * mixed[i]


@njit(cache=True, error_model="numpy")
def _compare(
    offsets: NDArray[np.int64],
    first: int,
    counts: NDArray[np.int64],
    weights: NDArray[np.float64],
    block: _Block,
    error: NDArray[np.float32],
) -> None:
    at = 0
    for j in range(len(counts)):
        p = first + j
        curve = error[offsets[p] + p : offsets[p + 1] + p + 1]
        n = counts[j]
        scale = weights[p] if len(weights) else 1.0
        red, green, blue = block.exact[0, j], block.exact[1, j], block.exact[2, j]
        for k in range(n):
            r, g, b = block.mixed[0, at + k] - red, block.mixed[1, at + k] - green, block.mixed[2, at + k] - blue
            squared = r * r + g * g + b * b
            curve[k] = squared * scale if squared > _ROUNDING else 0.0
        for k in range(n, len(curve)):
            curve[k] = 0.0
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
        core, sums = np.empty(3), np.empty(3)
        for p in range(lists.chunks[chunk], lists.chunks[chunk + 1]):
            n, k = offsets[p + 1] - offsets[p], kept[p]
            rgba, depth = lists.rgba[offsets[p] : offsets[p + 1]], lists.depth[offsets[p] : offsets[p + 1]]
            core[:], t = 0.0, 1.0
            for i in range(k):
                for c in range(3):
                    core[c] += t * level[rgba[i, 3]] * decode[rgba[i, c]]
                t *= 1.0 - level[rgba[i, 3]]
            sums[:], alphas, total, through = 0.0, 0.0, 0.0, 1.0
            steepness = _steepness(look, g, rgba, depth) if k < n else 0.0
            for i in range(n - 1, k - 1, -1):
                alpha = level[rgba[i, 3]]
                exponent = steepness * (np.float64(depth[i]) - np.float64(depth[0]))
                w = alpha * math.exp(-min(exponent, MAX_EXPONENT))
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
def _steepness(look: Look, g: float, rgba: NDArray[np.uint8], depth: NDArray[np.float32]) -> float:
    """`g D / (z_max - z_min)` of a list: the density tail's exponent per metre behind z_min."""
    extent = np.float64(depth[-1]) - np.float64(depth[0])
    if look.tail != DENSITY or extent <= 0.0:
        return 0.0
    total = 0.0
    for i in range(len(rgba)):
        total += look.optical[rgba[i, 3]]
    return g * total / extent
