"""Algorithm 1 of DHOIT without its heap, and its variant by increments (METHOD section 3).

A pixel's key is not pushed before its earlier ones are popped, so the heap pops in the order of
`(largest key of the pixel so far, pixel, step)`. The running maximum does not fall along a pixel's removals;
so the first R removals are those below one threshold, plus ties by pixel index: one selection a budget.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from labeller.curves import Curves
from labeller.selection import LAST_KEY, Selector, ascending_keys


class Removals:
    """The removal order of all fragments of a view, for any number of budgets.

    Args:
        curves: Error curves of the view.
        k_min: 0 or 1; no pixel goes below `min(k_min, n)`.
        key: `greedy`: the error after the removal, as Algorithm 1 is printed; `increment`: by how much it grows.
    """

    def __init__(self, curves: Curves, k_min: int, key: Literal["greedy", "increment"]) -> None:
        self._offsets = curves.offsets - np.arange(len(curves.offsets))
        values = np.empty(self._offsets[-1], dtype=np.float32)
        _running_maxima(self._offsets, curves.error, k_min, key == "increment", values)
        keys = ascending_keys(values)
        keys[np.isinf(values)] = LAST_KEY
        self._selector = Selector(keys)

    def keep(self, budget: int) -> NDArray[np.int32]:
        """int32 [P], k once no more than `budget` fragments are left; equal to the literal heap, ties included."""
        target = max(len(self._selector.keys) - budget, 0)
        end = self._selector.threshold(target)
        above, tied = _split(self._offsets, self._selector.keys, end.key)
        before = np.cumsum(tied, dtype=np.int64) - tied
        removed = np.clip(target - end.below - before, 0, tied)
        return np.asarray(above + tied - removed, dtype=np.int32)


@njit(parallel=True, cache=True)
def _running_maxima(
    offsets: NDArray[np.int64], error: NDArray[np.float32], k_min: int, increments: bool, out: NDArray[np.float32]
) -> None:
    # Entry offsets[p] + k - 1 is for the removal that leaves k - 1 fragments; +inf where k_min forbids it.
    for p in prange(len(offsets) - 1):
        first = offsets[p]
        curve = error[first + p : offsets[p + 1] + p + 1]
        largest = np.float32(-np.inf)
        for k in range(len(curve) - 1, 0, -1):
            if k <= k_min:
                out[first + k - 1] = np.float32(np.inf)
                continue
            value = curve[k - 1] - curve[k] if increments else curve[k - 1]
            largest = max(largest, value)
            out[first + k - 1] = largest


@njit(parallel=True, cache=True)
def _split(
    offsets: NDArray[np.int64], keys: NDArray[np.uint32], threshold: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    # A pixel's keys do not rise with k: those above the threshold come first, then those equal to it.
    above = np.empty(len(offsets) - 1, dtype=np.int32)
    tied = np.empty(len(offsets) - 1, dtype=np.int32)
    for p in prange(len(offsets) - 1):
        i = offsets[p]
        while i < offsets[p + 1] and np.int64(keys[i]) > threshold:
            i += 1
        above[p] = i - offsets[p]
        j = i
        while j < offsets[p + 1] and np.int64(keys[j]) == threshold:
            j += 1
        tied[p] = j - i
    return above, tied
