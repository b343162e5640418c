"""Whether depths can be paired with the intervals that rays allow."""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Intervals:
    """Least and greatest depth of some hits, float64 [n] each."""

    low: Floats
    high: Floats

    def of(self, rows: NDArray[np.generic]) -> Intervals:
        """Those of some rows (numbers, or a mask)."""
        return Intervals(self.low[rows], self.high[rows])

    def holds_all(self, depths: Floats) -> bool:
        """Whether every depth (ascending) can be given an interval of its own.

        Each takes the one that ends first among those that have begun: optimal for intervals.
        """
        return _pairs(depths, self) == len(depths)

    def all_held(self, depths: Floats) -> bool:
        """Whether every interval can be given a depth of its own.

        With `holds_all` of a larger set of intervals this gives one pairing that does both: if one matching covers a
        set on the left and one a set on the right, some matching covers both (Mendelsohn and Dulmage 1958).
        """
        return _pairs(depths, self) == len(self.low)

    def equal(self, depths: Floats) -> bool:
        """Whether depths and intervals pair up with nothing left on either side."""
        return len(depths) == len(self.low) and self.holds_all(depths)


def _pairs(depths: Floats, intervals: Intervals) -> int:
    """How many pairs can be made."""
    order = np.argsort(intervals.low, kind="stable")
    starts, ends = intervals.low[order].tolist(), intervals.high[order].tolist()
    begun: list[float] = []
    taken = pairs = 0
    for depth in depths.tolist():
        while taken < len(starts) and starts[taken] <= depth:
            heapq.heappush(begun, ends[taken])
            taken += 1
        while begun and begun[0] < depth:
            heapq.heappop(begun)
        if begun:
            heapq.heappop(begun)
            pairs += 1
    return pairs
