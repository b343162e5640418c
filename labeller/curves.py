"""Error curves of all pixels, and pictures of an allocation, in O(N) for a view (METHOD sections 2 and 3).

For each pixel a front-to-back pass leaves the core colour and transmittance of every k in scratch; a
back-to-front pass grows the tail's sums and compares each k with the exact colour. All arithmetic is float64.
A thread's scratch is as long as the longest list it meets, so memory is the curves themselves.
`labeller.reference` is the plain twin that the tests compare with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from schemas.colour import decode_gamma2, linear_to_srgb
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.tail import DENSITY_G, MAX_EXPONENT, METRICS, TAILS, MetricName, TailName

_CHUNKS: Final = 256  # more than threads, of equal numbers of fragments: crowded regions are shared out
_NODES: Final = 1024
_LINEAR_PART: Final = 0.0031308  # sRGB: below, the display value is 12.92 times the linear one
_LEVELS: Final = np.arange(256, dtype=np.float64) / 255.0
# Alpha 1 never is in a dump (schemas.fragments); should it be, the depth of the pixel stays finite.
_OPTICAL: Final = -np.log(np.maximum(1.0 - _LEVELS, 1e-3))
_DENSITY, _EXACT_COVERAGE, _WEIGHTED_AVERAGE, _PAPER = range(4)
_DISPLAY, _LINEAR, _STORED = range(3)
_ROUNDING: Final = 1e-24  # squared differences below this are the rounding of float64 sums: the pixel is exact


class _Lists(NamedTuple):
    """A dump, and the chunks of pixels that threads take."""

    offsets: NDArray[np.int64]
    rgba: NDArray[np.uint8]
    depth: NDArray[np.float32]
    background: NDArray[np.uint8]
    chunks: NDArray[np.int64]


class _Look(NamedTuple):
    """How lists become colours: tail, metric, and tables of the 256 stored values."""

    tail: int
    g: float
    space: int
    decode: NDArray[np.float64]
    level: NDArray[np.float64]
    optical: NDArray[np.float64]
    srgb: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Curves:
    """Error curves of a view: `e_p(k)` for k = 0..n(p) is `error[offsets[p] + k]`.

    Attributes:
        offsets: int64 [P+1].
        error: float32 [N+P], squared difference from the exact colour, summed over RGB; `e_p(n) = 0`.
        tail: Tail that stands for the fragments beyond k.
        g: Steepness of the density tail.
        metric: Space in which the difference is measured.
    """

    offsets: NDArray[np.int64]
    error: NDArray[np.float32]
    tail: TailName
    g: float
    metric: MetricName

    @property
    def counts(self) -> NDArray[np.int64]:
        """int64 [P], n(p)."""
        return np.diff(self.offsets) - 1

    def at(self, k: NDArray[np.integer]) -> NDArray[np.float32]:
        """float32 [P], `e_p(k_p)` for k int [P] with 0 <= k <= n."""
        return self.error[self.offsets[:-1] + k]

    def total(self, k: NDArray[np.integer]) -> float:
        """Sum of `e_p(k_p)` over the view, in float64."""
        return float(self.at(k).sum(dtype=np.float64))


def error_curves(
    dump: FragmentDump, tail: TailName = "density", g: float = DENSITY_G, metric: MetricName = "display"
) -> Curves:
    """Errors of all pixels for all numbers of core fragments.

    Args:
        dump: Fragments of a view.
        tail: One of `schemas.tail.TAILS`.
        g: Steepness of the density tail, >= 0.
        metric: `display`: sRGB, clamped; `linear`: linear RGB; `paper`: stored values composited as they are.

    Raises:
        Problem: If the dump is malformed or has a depth that is not finite.
    """
    check_dump(dump)
    offsets = dump.offsets + np.arange(dump.pixels + 1)
    error = np.empty(dump.total + dump.pixels, dtype=np.float32)
    _error_curves(_lists(dump), _look(tail, g, metric), error)
    return Curves(offsets, error, tail, float(g), metric)


def composite(
    dump: FragmentDump, k: NDArray[np.integer], tail: TailName = "density", g: float = DENSITY_G
) -> NDArray[np.float32]:
    """The picture that an allocation gives.

    Args:
        dump: Fragments of a view.
        k: int [P], core fragments of each pixel, >= 0; clipped to n(p), where the result is exact.
        tail: One of `schemas.tail.TAILS`.
        g: Steepness of the density tail.

    Returns:
        float32 [P, 3], linear RGB.

    Raises:
        Problem: If the dump is malformed or has a depth that is not finite.
    """
    check_dump(dump)
    out = np.empty((dump.pixels, 3), dtype=np.float32)
    kept = np.clip(np.asarray(k), 0, dump.counts).astype(np.int32)
    _composite(_lists(dump), _look(tail, g, "linear"), kept, out)
    return out


def check_dump(dump: FragmentDump) -> None:
    """Refuse a dump whose parts do not fit together, or with a depth that is not a positive number.

    Raises:
        Problem: What is wrong.
    """
    fits = (
        dump.offsets.shape == (dump.pixels + 1,)
        and dump.offsets[0] == 0
        and dump.offsets[-1] == dump.total == len(dump.rgba)
        and bool((dump.counts >= 0).all())
        and dump.background.shape == (dump.pixels, 3)
    )
    if not fits:
        raise Problem("The fragment dump is malformed: its lists do not fit its size.", "Render the view again.")
    if not (np.isfinite(dump.depth).all() and dump.depth.min(initial=1.0) > 0.0):
        raise Problem(
            "The fragment dump has depths that are not positive numbers.",
            "Look for NaN or infinite points in the scene, and render the view again.",
        )


def _lists(dump: FragmentDump) -> _Lists:
    work = dump.offsets + np.arange(dump.pixels + 1)
    chunks = np.searchsorted(work, np.linspace(0, work[-1], _CHUNKS + 1)).astype(np.int64)
    return _Lists(dump.offsets, dump.rgba, dump.depth, dump.background, chunks)


def _look(tail: TailName, g: float, metric: MetricName) -> _Look:
    decode = _LEVELS if metric == "paper" else decode_gamma2(np.arange(256, dtype=np.uint8))
    return _Look(TAILS.index(tail), float(g), METRICS.index(metric), decode, _LEVELS, _OPTICAL, _srgb_table())


def _srgb_table() -> NDArray[np.float64]:
    """float64 [_NODES, 4], cubic Hermite pieces of the sRGB power part over the square root s of linear light.

    Over s the curve `1.055 s^(5/6) - .055` is smooth where it is used (s > .056): the error stays below 1e-11,
    at a fifth of the cost of a power.
    """
    s = np.arange(_NODES + 1) / _NODES
    value = np.where(s > 0.0, linear_to_srgb(s * s), 0.0)
    power = 1.055 * s ** (5.0 / 6.0) - 0.055
    value = np.where(s > 0.04, power, value)
    slope = 1.055 * (5.0 / 6.0) * np.maximum(s, 1.0 / _NODES) ** (-1.0 / 6.0) / _NODES
    v0, v1, d0, d1 = value[:-1], value[1:], slope[:-1], slope[1:]
    return np.stack([v0, d0, 3.0 * (v1 - v0) - 2.0 * d0 - d1, 2.0 * (v0 - v1) + d0 + d1], axis=1)


@njit(inline="always")
def _encode(value: float, space: int, table: NDArray[np.float64]) -> float:
    if space != _DISPLAY:
        return value
    if value <= _LINEAR_PART:
        return 12.92 * max(value, 0.0)
    if value >= 1.0:
        return 1.0
    s = math.sqrt(value) * _NODES
    i = min(int(s), _NODES - 1)
    x = s - i
    return float(table[i, 0] + x * (table[i, 1] + x * (table[i, 2] + x * table[i, 3])))


@njit(inline="always")
def _tail_factors(tail: int, count: int, alpha_sum: float, weight_sum: float, through: float) -> tuple[float, float]:
    """What the tail's weighted colour sum, and the background, are multiplied with."""
    if count == 0 or weight_sum <= 0.0:
        return 0.0, 1.0
    if tail in (_WEIGHTED_AVERAGE, _PAPER):
        through = max(1.0 - alpha_sum / count, 0.0) ** count
    opacity = 1.0 if tail == _PAPER else 1.0 - through
    return opacity / weight_sum, through


@njit(inline="always")
def _steepness(look: _Look, rgba: NDArray[np.uint8], depth: NDArray[np.float32]) -> float:
    """`g D / (z_max - z_min)` of a pixel's list: the density tail's exponent per metre behind z_min."""
    extent = np.float64(depth[-1]) - np.float64(depth[0])
    if look.tail != _DENSITY or extent <= 0.0:
        return 0.0
    total = 0.0
    for i in range(len(rgba)):
        total += look.optical[rgba[i, 3]]
    return look.g * total / extent


@njit(inline="always")
def _weight(alpha: float, steepness: float, behind: float) -> float:
    if steepness == 0.0:
        return alpha
    return alpha * math.exp(-min(steepness * behind, MAX_EXPONENT))


@njit(parallel=True, cache=True, error_model="numpy")
def _error_curves(lists: _Lists, look: _Look, error: NDArray[np.float32]) -> None:
    offsets, decode, level = lists.offsets, look.decode, look.level
    chunks, background = lists.chunks, lists.background
    for chunk in prange(len(chunks) - 1):
        longest = 0
        for p in range(chunks[chunk], chunks[chunk + 1]):
            longest = max(longest, offsets[p + 1] - offsets[p])
        core = np.empty((longest + 1, 4))
        for p in range(chunks[chunk], chunks[chunk + 1]):
            n = offsets[p + 1] - offsets[p]
            curve = error[offsets[p] + p : offsets[p + 1] + p + 1]
            curve[n] = 0.0
            if n == 0:
                continue
            rgba, depth = lists.rgba[offsets[p] : offsets[p + 1]], lists.depth[offsets[p] : offsets[p + 1]]
            red, green, blue = decode[background[p, 0]], decode[background[p, 1]], decode[background[p, 2]]
            r, gr, b, t = 0.0, 0.0, 0.0, 1.0
            for i in range(n):
                core[i, 0], core[i, 1], core[i, 2], core[i, 3] = r, gr, b, t
                v = t * level[rgba[i, 3]]
                r += v * decode[rgba[i, 0]]
                gr += v * decode[rgba[i, 1]]
                b += v * decode[rgba[i, 2]]
                t *= 1.0 - level[rgba[i, 3]]
            exact_r = _encode(r + t * red, look.space, look.srgb)
            exact_g = _encode(gr + t * green, look.space, look.srgb)
            exact_b = _encode(b + t * blue, look.space, look.srgb)
            steepness = _steepness(look, rgba, depth)
            near = np.float64(depth[0])
            alpha_sum, weight_sum, through = 0.0, 0.0, 1.0
            r, gr, b = 0.0, 0.0, 0.0
            for k in range(n - 1, -1, -1):
                alpha = level[rgba[k, 3]]
                w = _weight(alpha, steepness, np.float64(depth[k]) - near)
                alpha_sum += alpha
                weight_sum += w
                through *= 1.0 - alpha
                r += w * decode[rgba[k, 0]]
                gr += w * decode[rgba[k, 1]]
                b += w * decode[rgba[k, 2]]
                share, behind = _tail_factors(look.tail, n - k, alpha_sum, weight_sum, through)
                t = core[k, 3]
                d_r = _encode(core[k, 0] + t * (share * r + behind * red), look.space, look.srgb) - exact_r
                d_g = _encode(core[k, 1] + t * (share * gr + behind * green), look.space, look.srgb) - exact_g
                d_b = _encode(core[k, 2] + t * (share * b + behind * blue), look.space, look.srgb) - exact_b
                squared = d_r * d_r + d_g * d_g + d_b * d_b
                curve[k] = squared if squared > _ROUNDING else 0.0


@njit(parallel=True, cache=True, error_model="numpy")
def _composite(lists: _Lists, look: _Look, kept: NDArray[np.int32], out: NDArray[np.float32]) -> None:
    offsets, decode, level = lists.offsets, look.decode, look.level
    chunks, background = lists.chunks, lists.background
    for chunk in prange(len(chunks) - 1):
        for p in range(chunks[chunk], chunks[chunk + 1]):
            n, k = offsets[p + 1] - offsets[p], kept[p]
            rgba, depth = lists.rgba[offsets[p] : offsets[p + 1]], lists.depth[offsets[p] : offsets[p + 1]]
            core, t = np.zeros(3), 1.0
            for i in range(k):
                for c in range(3):
                    core[c] += t * level[rgba[i, 3]] * decode[rgba[i, c]]
                t *= 1.0 - level[rgba[i, 3]]
            sums, alpha_sum, weight_sum, through = np.zeros(3), 0.0, 0.0, 1.0
            steepness = _steepness(look, rgba, depth) if k < n else 0.0
            for i in range(n - 1, k - 1, -1):
                alpha = level[rgba[i, 3]]
                w = _weight(alpha, steepness, np.float64(depth[i]) - np.float64(depth[0]))
                alpha_sum += alpha
                weight_sum += w
                through *= 1.0 - alpha
                for c in range(3):
                    sums[c] += w * decode[rgba[i, c]]
            share, behind = _tail_factors(look.tail, n - k, alpha_sum, weight_sum, through)
            for c in range(3):
                out[p, c] = core[c] + t * (share * sums[c] + behind * decode[background[p, c]])
