"""Selecting the first so many of millions of float32 keys without sorting them.

Keys become uint32 numbers of the same order; one histogram of their upper halves serves all budgets, a second
pass over the one bin that holds the threshold finds its lower half. Two O(M) passes for any number of ties.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import get_num_threads, njit, prange
from numpy.typing import NDArray

_BINS: Final = 1 << 16
LAST_KEY: Final = np.uint32(0xFFFFFFFF)
"""Above every key of a number."""


@dataclass(frozen=True, slots=True)
class Threshold:
    """Where a selection ends.

    Attributes:
        key: All items with smaller keys are selected, and none with larger ones; 2**32 if all items are.
        below: Sum of the weights of the items with smaller keys, at most the target.
    """

    key: int
    below: int


class Selector:
    """Keys of which several prefixes (by ascending key) are wanted.

    Args:
        keys: uint32 [M], see `ascending_keys`.
        weights: int32 [M], >= 0, or None: every item counts 1.
    """

    def __init__(self, keys: NDArray[np.uint32], weights: NDArray[np.int32] | None = None) -> None:
        self.keys = keys
        self._weights = np.empty(0, dtype=np.int32) if weights is None else weights
        self._upper = np.cumsum(_upper_histogram(keys, self._weights, get_num_threads()).sum(axis=0))

    def threshold(self, target: int) -> Threshold:
        """The largest key such that the items with smaller keys weigh at most `target` together."""
        if target >= self._upper[-1]:
            return Threshold(1 << 32, int(self._upper[-1]))
        upper = int(np.searchsorted(self._upper, target, side="right"))
        before = int(self._upper[upper - 1]) if upper else 0
        lower_sums = np.cumsum(_lower_histogram(self.keys, self._weights, upper, get_num_threads()).sum(axis=0))
        lower = int(np.searchsorted(lower_sums, target - before, side="right"))
        return Threshold((upper << 16) | lower, before + (int(lower_sums[lower - 1]) if lower else 0))


def ascending_keys(values: NDArray[np.float32]) -> NDArray[np.uint32]:
    """uint32 keys in the order of the float32 values (no NaN), any shape."""
    bits = np.ascontiguousarray(values, dtype=np.float32).view(np.uint32)
    return np.where(bits >> 31, ~bits, bits | np.uint32(0x80000000)).astype(np.uint32)


@njit(parallel=True, cache=True)
def _upper_histogram(keys: NDArray[np.uint32], weights: NDArray[np.int32], parts: int) -> NDArray[np.int64]:
    counts = np.zeros((parts, _BINS), dtype=np.int64)
    for part in prange(parts):
        row = counts[part]
        for i in range(len(keys) * part // parts, len(keys) * (part + 1) // parts):
            row[keys[i] >> 16] += weights[i] if len(weights) else 1
    return counts


@njit(parallel=True, cache=True)
def _lower_histogram(keys: NDArray[np.uint32], weights: NDArray[np.int32], upper: int, parts: int) -> NDArray[np.int64]:
    counts = np.zeros((parts, _BINS), dtype=np.int64)
    for part in prange(parts):
        row = counts[part]
        for i in range(len(keys) * part // parts, len(keys) * (part + 1) // parts):
            if keys[i] >> 16 == upper:
                row[keys[i] & 0xFFFF] += weights[i] if len(weights) else 1
    return counts
