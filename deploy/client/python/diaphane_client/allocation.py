"""From ranks of prices to the whole bins that are every pixel's core: what the renderer's passes do, in numpy.

METHOD section 4 has the rule. All numbers are integers, so that the cuts are those of the shaders to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diaphane_client.constants import FULL, MOST_CORE, RANKS
from diaphane_client.prices import check_counts


@dataclass(frozen=True)
class Cuts:
    """Cores that meet a budget.

    Attributes:
        cut: int32 [P], bins in each pixel's core, from the nearest.
        k: int32 [P], fragments in them; their sum is at most the budget, and less by at most one bin of one pixel.
        complete: Whether all that can be in a core is.
    """

    cut: NDArray[np.int32]
    k: NDArray[np.int32]
    complete: bool


def allocate(ranks: NDArray[np.integer], counts: NDArray[np.integer], F: int) -> Cuts:
    """Whole bins at the one rank of prices that uses a budget.

    All pixels get the bins of lower ranks. What is left goes to the pixels that grow at the rank itself, by index; the
    first that does not fit takes those of its bins that do.

    Args:
        ranks: int [P, bins], of the price from which each bin is in the core, 0 to 255, not falling along the bins.
        counts: int [P, bins], fragments in each depth bin; 255 for that many or more, which are never in a core.
        F: Fragments to spend.

    Raises:
        ValueError: An argument is not as described.
    """
    growth, rank = _usable(counts, F), np.asarray(ranks)
    if rank.shape != growth.shape or not np.issubdtype(rank.dtype, np.integer):
        raise ValueError("ranks must be whole numbers, one for each count")
    if rank.size and (rank.min() < 0 or rank.max() >= RANKS or (rank[:, 1:] < rank[:, :-1]).any()):
        raise ValueError(f"ranks must be 0 to {RANKS - 1}, and not fall from bin to bin")
    grows = growth > 0
    if growth.sum() <= F:
        return _cuts(growth, grows, complete=True)
    spent = np.cumsum(np.bincount(rank[grows], weights=growth[grows], minlength=RANKS)).astype(np.int64)
    chosen = int(np.searchsorted(spent, F, side="right"))
    granted, more = grows & (rank < chosen), grows & (rank == chosen)
    # Pixel by pixel, in each bin by bin: up to the first of them that does not fit.
    fits = np.cumsum((growth * more).ravel()) <= F - int((growth * granted).sum())
    return _cuts(growth, granted | (more & fits.reshape(more.shape)), complete=False)


def _cuts(growth: NDArray[np.int64], granted: NDArray[np.bool_], *, complete: bool) -> Cuts:
    cut = (np.arange(1, growth.shape[1] + 1) * granted).max(axis=1, initial=0)
    return Cuts(cut.astype(np.int32), (growth * granted).sum(axis=1).astype(np.int32), complete)


def _usable(counts: NDArray[np.integer], F: int) -> NDArray[np.int64]:
    """int64 [P, bins], fragments of the bins that can be in a core; 0 from the first one on that cannot."""
    check_counts(counts)
    if F < 0:
        raise ValueError("the budget must not be negative")
    own = np.minimum(counts, FULL).astype(np.int64)
    fits = (own < FULL) & (np.cumsum(own, axis=1) <= MOST_CORE)
    return np.asarray(np.where(np.logical_and.accumulate(fits, axis=1), own, 0))
