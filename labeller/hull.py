"""Lower convex hulls of error curves: what a Lagrangian allocation can reach (METHOD section 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from labeller.curves import Curves


@dataclass(frozen=True, slots=True)
class Hulls:
    """Hull vertices of all pixels that can gain; those of pixel p are `offsets[p]:offsets[p+1]`.

    A pixel's first vertex is at k = 0, its last one where the error first is 0. Empty pixels, and those that are exact
    at k = 0 already, have no vertices: they take no part.

    Attributes:
        offsets: int64 [P+1].
        k: int32 [M], ascending within a pixel.
        error: float32 [M], falling within a pixel, ever more slowly.
    """

    offsets: NDArray[np.int64]
    k: NDArray[np.int32]
    error: NDArray[np.float32]

    def steps(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Of the step that leads to each vertex from the one before it.

        Returns:
            float32 [M], error saved per fragment, not rising within a pixel, rounding included; and int32 [M], its
            fragments. At a pixel's first vertex, to which no step leads, +inf and 0.
        """
        slopes, lengths = np.empty(len(self.k), dtype=np.float32), np.empty(len(self.k), dtype=np.int32)
        _steps(self.offsets, self.k, self.error, slopes, lengths)
        return slopes, lengths


def lower_hulls(curves: Curves) -> Hulls:
    """Hulls of the curves on `0..n`; their trailing flat part (error 0) is dropped.

    Args:
        curves: Error curves of a view.
    """
    scratch = np.empty(len(curves.error), dtype=np.int32)
    sizes = np.zeros(len(curves.offsets) - 1, dtype=np.int64)
    _hulls(curves.offsets, curves.error, scratch, sizes)
    offsets = np.concatenate([np.zeros(1, np.int64), np.cumsum(sizes)])
    k, error = np.empty(offsets[-1], dtype=np.int32), np.empty(offsets[-1], dtype=np.float32)
    _compact(curves.offsets, curves.error, scratch, offsets, k, error)
    return Hulls(offsets, k, error)


@njit(parallel=True, cache=True, error_model="numpy")
def _hulls(
    offsets: NDArray[np.int64],
    error: NDArray[np.float32],
    scratch: NDArray[np.int32],
    sizes: NDArray[np.int64],
) -> None:
    for p in prange(len(sizes)):
        first = offsets[p]
        n = offsets[p + 1] - first - 1
        if error[first] == 0.0:  # an empty pixel's one entry, too
            continue
        stack = scratch[first : first + n + 1]
        size = 0
        for k in range(n + 1):
            e = np.float64(error[first + k])
            while size >= 2:
                i, j = stack[size - 2], stack[size - 1]
                e_i, e_j = np.float64(error[first + i]), np.float64(error[first + j])
                if (e_i - e_j) * (k - j) > (e_j - e) * (j - i):
                    break
                size -= 1
            stack[size] = k
            size += 1
            if e == 0.0:
                break
        sizes[p] = size


@njit(parallel=True, cache=True, error_model="numpy")
def _compact(
    curve_offsets: NDArray[np.int64],
    curve_error: NDArray[np.float32],
    scratch: NDArray[np.int32],
    offsets: NDArray[np.int64],
    k: NDArray[np.int32],
    error: NDArray[np.float32],
) -> None:
    for p in prange(len(offsets) - 1):
        first = curve_offsets[p]
        for i in range(offsets[p + 1] - offsets[p]):
            vertex = scratch[first + i]
            k[offsets[p] + i] = vertex
            error[offsets[p] + i] = curve_error[first + vertex]


@njit(parallel=True, cache=True, error_model="numpy")
def _steps(
    offsets: NDArray[np.int64],
    k: NDArray[np.int32],
    error: NDArray[np.float32],
    slopes: NDArray[np.float32],
    lengths: NDArray[np.int32],
) -> None:
    for p in prange(len(offsets) - 1):
        last, before = np.float32(np.inf), np.int32(0)
        for i in range(offsets[p], offsets[p + 1]):
            length = k[i] - before if i > offsets[p] else np.int32(0)
            if i > offsets[p]:
                saved = np.float64(error[i - 1]) - np.float64(error[i])
                last = min(last, np.float32(saved / length))
            slopes[i], lengths[i], before = last, length, k[i]
