"""Pixels on their way down their hulls: every step that saves more than a price, in one pass over a part of a view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from labeller.core_problem import Core
from labeller.curves import Curves
from labeller.hull import Hulls
from labeller.selection import END, Threshold

_CHUNKS: Final = 256  # more than threads, of equal numbers of vertices
_WINDOW: Final = 1
_TIED: Final = 2


@dataclass(frozen=True, slots=True)
class Part:
    """Consecutive pixels of a view.

    Attributes:
        curves: Their error curves.
        hulls: The lower hulls of those.
        keys: uint32 [M], order of the steps that lead to the hulls' vertices: falling slopes.
        lengths: int32 [M], fragments of the steps.
        chunks: int64, bounds of runs of pixels with about as many vertices, which threads take.
    """

    curves: Curves
    hulls: Hulls
    keys: NDArray[np.uint32]
    lengths: NDArray[np.int32]
    chunks: NDArray[np.int64]


def part_of(curves: Curves, hulls: Hulls) -> Part:
    """Pixels as the allocator takes them."""
    slopes, lengths = hulls.steps()
    keys = slopes.view(np.uint32)
    np.bitwise_xor(keys, np.uint32(0x7FFFFFFF), out=keys)  # floats that are not negative, in falling order
    work = hulls.offsets + np.arange(len(hulls.offsets))
    chunks = np.searchsorted(work, np.linspace(0, work[-1], _CHUNKS + 1)).astype(np.int64)
    return Part(curves, hulls, keys, lengths, chunks)


def slope_of(key: int) -> float:
    """Error saved per fragment of the steps that have a key; 0 beyond all steps."""
    return float(np.uint32(key ^ 0x7FFFFFFF).view(np.float32)) if key < END else 0.0


@dataclass(frozen=True, slots=True)
class Descent:
    """Where a part's pixels stand at a threshold.

    Attributes:
        k: int32 [P], after all steps below the threshold, and those equal to it that fit.
        spent: Fragments of the steps equal to the threshold.
        slope: Error saved per fragment of the first of those steps, not rounded; 0 if there is none.
        error: float64, sums of the errors of the pixels that have no step in the window.
        dual: float64, sums of `e_p(j)` at the j that minimise `e_p(j) + lambda j`, and what rounding took from them.
        dual_k: Sum of those j.
        window: int64, pixels with a step in the window.
        outside: How many pixels have steps, but none in the window.
    """

    k: NDArray[np.int32]
    spent: int
    slope: float
    error: NDArray[np.float64]
    dual: NDArray[np.float64]
    dual_k: int
    window: NDArray[np.int64]
    outside: int


def descend(part: Part, end: Threshold, left: int) -> Descent:
    """Take a part's steps up to a threshold.

    Args:
        part: The pixels.
        end: The threshold; steps between its `first` and `last` are the window.
        left: Fragments that steps equal to the threshold may take; they get them by pixel index.
    """
    hulls, pixels = part.hulls, len(part.hulls.offsets) - 1
    steps = _Steps(part.curves.offsets, hulls.offsets, hulls.k, hulls.error, part.keys)
    k, flags = np.empty(pixels, dtype=np.int32), np.zeros(pixels, dtype=np.uint8)
    error, dual, counts = np.zeros(_CHUNKS), np.zeros((_CHUNKS, 2)), np.zeros((_CHUNKS, 2), dtype=np.int64)
    _walk(part.chunks, steps, (end.key, end.first, end.last, slope_of(end.key)), k, flags, error, dual, counts)
    spent, slope = _take_ties(np.flatnonzero(flags & _TIED), steps, end.key, left, k)
    dual_k, outside = counts.sum(axis=0)
    return Descent(k, spent, slope, error, dual.reshape(-1), int(dual_k), np.flatnonzero(flags), int(outside))


def core_of(part: Part, pixels: NDArray[np.int64], k: NDArray[np.int32]) -> Core:
    """Some pixels, whole curves, as `labeller.core_problem` takes them.

    Args:
        part: The part they are of.
        pixels: int64 [C], their indices in the part.
        k: int32 [P], where the part's pixels stand.
    """
    curves = part.curves
    first = curves.offsets[pixels]
    sizes = curves.offsets[pixels + 1] - first
    offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes)])
    where = np.arange(offsets[-1]) + np.repeat(first - offsets[:-1], sizes)
    return Core(offsets, curves.error[where], k[pixels])


class _Steps(NamedTuple):
    curve_offsets: NDArray[np.int64]
    offsets: NDArray[np.int64]
    vertex: NDArray[np.int32]
    error: NDArray[np.float32]
    keys: NDArray[np.uint32]


@njit(parallel=True, cache=True, error_model="numpy")
def _walk(
    chunks: NDArray[np.int64],
    steps: _Steps,
    end: tuple[int, int, int, float],
    k: NDArray[np.int32],
    flags: NDArray[np.uint8],
    error: NDArray[np.float64],
    dual: NDArray[np.float64],
    counts: NDArray[np.int64],
) -> None:
    threshold, first, last, lam = end
    for chunk in prange(len(chunks) - 1):
        # Neumaier's compensated sums: errors of very different size meet here.
        error_sum, error_lost, dual_sum, dual_lost, fragments, outside = 0.0, 0.0, 0.0, 0.0, 0, 0
        for p in range(chunks[chunk], chunks[chunk + 1]):
            begin, after = steps.offsets[p], steps.offsets[p + 1]
            if begin == after:  # exact whatever it gets: it takes no part
                k[p] = 0
                continue
            chosen, cheapest, flag = begin, begin, np.uint8(0)
            for i in range(begin, after):
                key = np.int64(steps.keys[i])
                if key > last:
                    break
                if key < threshold:
                    chosen = i
                more = lam * (steps.vertex[i] - steps.vertex[cheapest])
                if np.float64(steps.error[i]) - np.float64(steps.error[cheapest]) + more < 0.0:
                    cheapest = i
                if key >= first and i > begin:
                    flag |= np.uint8(_TIED if key == threshold else _WINDOW)
            k[p], flags[p] = steps.vertex[chosen], flag
            fragments += steps.vertex[cheapest]
            value = np.float64(steps.error[cheapest])
            total = dual_sum + value
            dual_lost += (dual_sum - total) + value if dual_sum >= value else (value - total) + dual_sum
            dual_sum = total
            if flag == 0:
                outside += 1
                value = np.float64(steps.error[chosen])
                total = error_sum + value
                error_lost += (error_sum - total) + value if error_sum >= value else (value - total) + error_sum
                error_sum = total
        error[chunk], dual[chunk, 0], dual[chunk, 1] = error_sum + error_lost, dual_sum, dual_lost
        counts[chunk, 0], counts[chunk, 1] = fragments, outside


@njit(cache=True)
def _take_ties(
    pixels: NDArray[np.int64], steps: _Steps, threshold: int, left: int, k: NDArray[np.int32]
) -> tuple[int, float]:
    spent, slope = 0, 0.0
    for p in pixels:
        for i in range(steps.offsets[p] + 1, steps.offsets[p + 1]):
            key = np.int64(steps.keys[i])
            if key == threshold:
                length = steps.vertex[i] - steps.vertex[i - 1]
                if slope == 0.0:
                    slope = (np.float64(steps.error[i - 1]) - np.float64(steps.error[i])) / length
                if length > left - spent:
                    break
                spent += length
                k[p] = steps.vertex[i]
            elif key > threshold:
                break
    return spent, slope
