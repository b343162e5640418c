"""Selecting the first so many of millions of float32 keys without sorting them.

Keys become uint32 numbers of the same order; one histogram of their upper halves serves all targets, a second
pass over the few bins that hold the thresholds finds their lower halves. Two O(M) passes for any number of ties,
and both add up over parts, so that a view may come in row bands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import get_num_threads, njit, prange
from numpy.typing import NDArray

_BINS: Final = 1 << 16
_AT_ONCE: Final = 32  # bins that are split in one pass: half a megabyte each, for every thread
LAST_KEY: Final = np.uint32(0xFFFFFFFF)
"""Above every key of a number."""
END: Final = 1 << 32
"""Threshold that lies above all keys: everything is selected."""

Items = tuple[NDArray[np.uint32], NDArray[np.int32]]
"""Keys uint32 [M] and their weights int32 [M] >= 0; empty weights: every item counts 1."""


@dataclass(frozen=True, slots=True)
class Threshold:
    """Where a selection ends, and a window around it.

    Attributes:
        key: All items with smaller keys are selected, and none with larger ones; `END` if all items are.
        below: Sum of the weights of the items with smaller keys, at most the target.
        first: Least key of the window; 0 if there is none below.
        last: Greatest key of the window; `END` if there is none above.
    """

    key: int
    below: int
    first: int = 0
    last: int = END


class Histogram:
    """Weights by the upper half of the keys, added up over parts.

    Args:
        parts: The items of all parts.
    """

    def __init__(self, parts: Iterable[Items]) -> None:
        counts = np.zeros(_BINS, dtype=np.int64)
        for keys, weights in parts:
            counts += _upper_histogram(keys, weights, get_num_threads()).sum(axis=0)
        self._sums = np.cumsum(counts)

    @property
    def total(self) -> int:
        """Sum of all weights."""
        return int(self._sums[-1])

    def thresholds(
        self, targets: Sequence[int], parts: Callable[[], Iterable[Items]], around: int = 0
    ) -> list[Threshold]:
        """For each target the largest key such that the items with smaller keys weigh at most that together.

        Args:
            targets: Sums of weights, >= 0.
            parts: Gives the same items again; called once for every 32 bins that have to be split.
            around: What the window shall weigh at least on either side of the threshold, where there is so much.
        """
        bins = [int(np.searchsorted(self._sums, t, side="right")) if t < self.total else -1 for t in targets]
        split = sorted(set(bins) - {-1})
        sums: dict[int, NDArray[np.int64]] = {}
        for first in range(0, len(split), _AT_ONCE):
            some = split[first : first + _AT_ONCE]
            rows = np.full(_BINS, -1, dtype=np.int32)
            rows[some] = np.arange(len(some))
            lower = np.zeros((len(some), _BINS), dtype=np.int64)
            for keys, weights in parts():
                lower += _lower_histograms(keys, weights, rows, len(some), get_num_threads()).sum(axis=0)
            sums.update(zip(some, np.cumsum(lower, axis=1), strict=True))
        return [
            Threshold(END, self.total) if upper < 0 else self._threshold(t, upper, sums[upper], around)
            for t, upper in zip(targets, bins, strict=True)
        ]

    def _threshold(self, target: int, upper: int, sums: NDArray[np.int64], around: int) -> Threshold:
        before = self._before(upper)
        lower = int(np.searchsorted(sums, target - before, side="right"))
        below = before + (int(sums[lower - 1]) if lower else 0)
        upto = before + int(sums[lower])
        return Threshold((upper << 16) | lower, below, *self._window(upper, sums, below - around, upto + around))

    def _window(self, upper: int, sums: NDArray[np.int64], least: int, most: int) -> tuple[int, int]:
        # Within the bin by its lower halves; beyond it by whole bins.
        before, after = self._before(upper), int(self._sums[upper])
        if least >= before:
            first = (upper << 16) | int(np.searchsorted(sums, least - before, side="right"))
        else:
            first = int(np.searchsorted(self._sums, least, side="right")) << 16 if least > 0 else 0
        if most <= after:
            last = (upper << 16) | int(np.searchsorted(sums, most - before, side="left"))
        elif most >= self.total:
            last = END
        else:
            last = ((int(np.searchsorted(self._sums, most, side="left")) + 1) << 16) - 1
        return first, last

    def _before(self, upper: int) -> int:
        return int(self._sums[upper - 1]) if upper else 0


def ascending_keys(values: NDArray[np.float32]) -> NDArray[np.uint32]:
    """uint32 keys in the order of the float32 values (no NaN). The values' memory becomes that of the keys.

    Args:
        values: float32 [N], without NaN; overwritten.
    """
    keys = values.view(np.uint32)
    _to_keys(keys)
    return keys


@njit(parallel=True, cache=True)
def _to_keys(bits: NDArray[np.uint32]) -> None:
    for i in prange(len(bits)):
        bits[i] = ~bits[i] if bits[i] >> 31 else bits[i] | np.uint32(0x80000000)


@njit(parallel=True, cache=True)
def _upper_histogram(keys: NDArray[np.uint32], weights: NDArray[np.int32], parts: int) -> NDArray[np.int64]:
    counts = np.zeros((parts, _BINS), dtype=np.int64)
    for part in prange(parts):
        row = counts[part]
        for i in range(len(keys) * part // parts, len(keys) * (part + 1) // parts):
            row[keys[i] >> 16] += weights[i] if len(weights) else 1
    return counts


@njit(parallel=True, cache=True)
def _lower_histograms(
    keys: NDArray[np.uint32], weights: NDArray[np.int32], rows: NDArray[np.int32], count: int, parts: int
) -> NDArray[np.int64]:
    counts = np.zeros((parts, count, _BINS), dtype=np.int64)
    for part in prange(parts):
        for i in range(len(keys) * part // parts, len(keys) * (part + 1) // parts):
            row = rows[keys[i] >> 16]
            if row >= 0:
                counts[part, row, keys[i] & 0xFFFF] += weights[i] if len(weights) else 1
    return counts
