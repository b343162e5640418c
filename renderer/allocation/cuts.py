"""Whole bins within a budget: what `renderer/shaders/allocation` does, in numpy.

A pixel's core is all fragments of its first bins: its *cut* is how many bins. How many fragments that are is known
before any is captured, so capturing them is an append. Each bin has a rank, that of the price from which it is worth
its fragments (`renderer.allocation.prices`), and ranks rise from the nearest bin to the farthest.

So a frame has events, each a rank and the fragments that come with it, and the rank that uses a budget is the last one
up to which all of them fit: a selection by one count of fragments by rank, not a search. What is then left goes to the
pixels that grow at the next rank, by index, and the first that does not fit takes those of its bins that do:
`sum k <= F`, met up to one bin of one pixel.

All numbers are integers: the shaders give the same to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from schemas.tail import COUNT_LIMIT

FULL: Final = COUNT_LIMIT
"""What a bin's count says of this many fragments or more: such a bin is never in a core."""
MOST_CORE: Final = 1023
"""Fragments of one core: a shader sorts them by itself."""


@dataclass(frozen=True, slots=True)
class Events:
    """Cuts of every pixel, in order, as they become worth it.

    Attributes:
        rank: int64 [P, B], of the price from which bin b is in the core, rising with b.
        growth: int64 [P, B], fragments that come with it; 0: nothing does.
    """

    rank: NDArray[np.int64]
    growth: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Cuts:
    """Cores that meet a budget.

    Attributes:
        cut: int32 [P], bins in the core, from the nearest.
        k: int32 [P], their fragments.
        rank: Greatest rank of a price that all pixels are granted; None: all that can be in a core is.
    """

    cut: NDArray[np.int32]
    k: NDArray[np.int32]
    rank: int | None


def usable_counts(counts: NDArray[np.integer]) -> NDArray[np.int64]:
    """Fragments of the bins that can be in a core, int64 [P, B]; 0 from the first bin on that cannot.

    Args:
        counts: [P, B], fragments of each bin, FULL for that many or more.
    """
    given = np.asarray(counts, dtype=np.int64)
    fits = (given < FULL) & (np.cumsum(given, axis=1) <= MOST_CORE)
    return np.where(np.logical_and.accumulate(fits, axis=1), given, 0)


def events_of(ranks: NDArray[np.integer], counts: NDArray[np.integer]) -> Events:
    """What the pixels ask for at which price.

    Args:
        ranks: [P, B], of the price of each bin, rising along B.
        counts: [P, B], fragments of each bin.
    """
    return Events(np.asarray(ranks, dtype=np.int64), usable_counts(counts))


def solve_cuts(events: Events, budget: int) -> Cuts:
    """The cuts at the price that uses a budget.

    Args:
        events: Of every pixel.
        budget: F, fragments to spend.
    """
    growth = events.growth
    if budget >= growth.sum():
        return _cuts(growth, growth > 0, None)
    order = np.argsort(events.rank[growth > 0], kind="stable")
    ranks, spent = events.rank[growth > 0][order], np.cumsum(growth[growth > 0][order])
    rank = int(ranks[np.searchsorted(spent, budget, side="right")]) - 1
    granted = (growth > 0) & (events.rank <= rank)
    more = (growth > 0) & (events.rank == rank + 1)
    # Pixel by pixel, in each bin by bin: up to the first of them that does not fit.
    fits = np.cumsum((growth * more).ravel()) <= budget - int((growth * granted).sum())
    return _cuts(growth, granted | (more & fits.reshape(more.shape)), rank)


def _cuts(growth: NDArray[np.int64], granted: NDArray[np.bool_], rank: int | None) -> Cuts:
    bins = np.arange(1, growth.shape[1] + 1)
    cut = (bins * granted).max(axis=1, initial=0)
    return Cuts(cut.astype(np.int32), (growth * granted).sum(axis=1).astype(np.int32), rank)
