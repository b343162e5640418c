"""Algorithm 1 of DHOIT without its heap, and its variant by increments (METHOD section 3).

Algorithm 1 is the oracle that errors are given relative to, so it stays as its authors have it: it alone keeps
`DHOIT_K_MIN` fragments of every occupied pixel, where the budget covers that.

A pixel's key is not pushed before its earlier ones are popped, so the heap pops in the order of
`(largest key of the pixel so far, pixel, step)`. The running maximum does not fall along a pixel's removals;
so the first R removals are those below one threshold, plus ties by pixel index: one selection a budget.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Final, Literal, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from labeller.curves import Curves
from labeller.selection import LAST_KEY, Histogram, Threshold, ascending_keys

RemovalName = Literal["greedy", "increment"]
DHOIT_K_MIN: Final = 1
"""Fewest fragments that Algorithm 1 leaves an occupied pixel."""
_NO_WEIGHTS = np.empty(0, dtype=np.int32)


class RemovalKeys(NamedTuple):
    """Keys of all removals of consecutive pixels; entry `offsets[p] + k - 1` is for the one that leaves k - 1.

    Attributes:
        offsets: int64 [P+1].
        keys: uint32 [N], not rising within a pixel; `LAST_KEY` where the removal is forbidden.
    """

    offsets: NDArray[np.int64]
    keys: NDArray[np.uint32]


def least_kept(key: RemovalName, occupied: int, budget: int) -> int:
    """Fewest fragments that a rule leaves an occupied pixel.

    Args:
        key: The rule.
        occupied: Pixels with fragments.
        budget: F.
    """
    return DHOIT_K_MIN if key == "greedy" and budget >= DHOIT_K_MIN * occupied else 0


def removal_keys(curves: Curves, least: int, key: RemovalName) -> RemovalKeys:
    """The order in which the fragments of some pixels are removed.

    Args:
        curves: Error curves of the pixels.
        least: No pixel goes below `min(least, n)`.
        key: `greedy`: the error after the removal, as Algorithm 1 is printed; `increment`: by how much it grows.
    """
    offsets = curves.offsets - np.arange(len(curves.offsets))
    values = np.empty(offsets[-1], dtype=np.float32)
    _running_maxima(offsets, curves.error, key == "increment", values)
    keys = ascending_keys(values)
    _forbid(offsets, least, keys)
    return RemovalKeys(offsets, keys)


class Removals:
    """The removal order of all fragments of a view, for any number of budgets.

    Args:
        parts: Gives the keys of the view's pixels, in one part or in several one after the other; called anew for
            each pass.
    """

    def __init__(self, parts: Callable[[], Iterable[RemovalKeys]]) -> None:
        self._parts = parts
        self._histogram = Histogram((part.keys, _NO_WEIGHTS) for part in parts())

    def keep(self, budgets: Sequence[int]) -> list[NDArray[np.int32]]:
        """What is kept once no more fragments are left than a budget allows; equal to the literal heap, ties included.

        Args:
            budgets: F, at least `sum min(least, n)` of the keys.

        Returns:
            int32 [P] for each budget.
        """
        targets = [max(self._histogram.total - budget, 0) for budget in budgets]
        ends = self._histogram.thresholds(targets, lambda: ((part.keys, _NO_WEIGHTS) for part in self._parts()))
        left = [target - end.below for target, end in zip(targets, ends, strict=True)]
        kept: list[list[NDArray[np.int32]]] = [[] for _ in budgets]
        for part in self._parts():
            for j, end in enumerate(ends):
                k, left[j] = _keep(part, end, left[j])
                kept[j].append(k)
        return [np.concatenate(k) if len(k) != 1 else k[0] for k in kept]


def _keep(part: RemovalKeys, end: Threshold, left: int) -> tuple[NDArray[np.int32], int]:
    """K of a part's pixels, and how many of the removals equal to the threshold are left for the next part."""
    k, tied = np.empty((2, len(part.offsets) - 1), dtype=np.int32)
    _split(part.offsets, part.keys, end.key, k, tied)
    pixels = np.flatnonzero(tied)
    ties = tied[pixels].astype(np.int64)
    removed = np.clip(left - (np.cumsum(ties) - ties), 0, ties)
    k[pixels] -= removed.astype(np.int32)
    return k, left - int(removed.sum())


@njit(parallel=True, cache=True)
def _running_maxima(
    offsets: NDArray[np.int64], error: NDArray[np.float32], increments: bool, out: NDArray[np.float32]
) -> None:
    for p in prange(len(offsets) - 1):
        first = offsets[p]
        curve = error[first + p : offsets[p + 1] + p + 1]
        largest = np.float32(-np.inf)
        for k in range(len(curve) - 1, 0, -1):
            value = curve[k - 1] - curve[k] if increments else curve[k - 1]
            largest = max(largest, value)
            out[first + k - 1] = largest


@njit(parallel=True, cache=True)
def _forbid(offsets: NDArray[np.int64], least: int, keys: NDArray[np.uint32]) -> None:
    for p in prange(len(offsets) - 1):
        for i in range(offsets[p], min(offsets[p] + least, offsets[p + 1])):
            keys[i] = LAST_KEY


@njit(parallel=True, cache=True)
def _split(
    offsets: NDArray[np.int64], keys: NDArray[np.uint32], threshold: int, k: NDArray[np.int32], tied: NDArray[np.int32]
) -> None:
    # A pixel's keys do not rise with k: those above the threshold come first, then those equal to it.
    for p in prange(len(offsets) - 1):
        above = _first_at_most(keys, offsets[p], offsets[p + 1], threshold)
        equal = above
        while equal < offsets[p + 1] and np.int64(keys[equal]) == threshold:
            equal += 1
        k[p], tied[p] = equal - offsets[p], equal - above


@njit(inline="always")
def _first_at_most(keys: NDArray[np.uint32], low: int, high: int, threshold: int) -> int:
    while low < high:
        middle = (low + high) >> 1
        if np.int64(keys[middle]) > threshold:
            low = middle + 1
        else:
            high = middle
    return low
