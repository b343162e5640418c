"""At which price each bin is worth its fragments: what a network's answers mean, as ranks (METHOD section 4).

A bin's log gain is what the network answers for it, and `prior` times what the tail itself tells; its price is the
negative of that. Ranks are prices in whole steps, and do not fall from the nearest bin to the farthest. Arithmetic is
float32, operation by operation, as in the renderer's numpy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from diaphane_client.constants import (
    LEAST_ALONE,
    LEAST_COVERED,
    LEAST_IMPORTANCE,
    LEAST_PRICE,
    LEAST_PRIOR,
    MOST_ALONE,
    MOST_BINS,
    PRICE_STEPS,
    RANKS,
)

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Bins:
    """What a renderer has gathered of the depth bins of P pixels, all as the tail keeps it.

    Attributes:
        counts: int [P, bins], fragments in each; 255 for that many or more, which are never in a core.
        front: [P, bins - 1], share of the optical depth in front of the second bin and of those behind it.
        optical_depth: [P], sum of -ln(1 - a) of all fragments.
    """

    counts: NDArray[np.integer]
    front: NDArray[np.floating]
    optical_depth: NDArray[np.floating]

    def check(self, bins: int) -> None:
        """Refuses what cannot be.

        Args:
            bins: Of the tail.

        Raises:
            ValueError: A shape, a type or a number is not as described.
        """
        check_counts(self.counts)
        pixels, found = np.shape(self.counts)
        if found != bins:
            raise ValueError(f"the tail has {bins} bins: give as many columns of counts")
        for numbers, shape in ((self.front, (pixels, bins - 1)), (self.optical_depth, (pixels,))):
            if np.shape(numbers) != shape or not np.isfinite(numbers).all():
                raise ValueError(f"shares in front of bins and optical depths must be finite: {list(shape)} of them")


def check_counts(counts: NDArray[np.integer]) -> None:
    """Refuses counts that are none.

    Args:
        counts: Integers [P, bins], fragments of each depth bin of each pixel.

    Raises:
        ValueError: They are not whole numbers >= 0, [P, 1 to MOST_BINS].
    """
    given = np.asarray(counts)
    if given.ndim != 2 or not 1 <= given.shape[1] <= MOST_BINS or not np.issubdtype(given.dtype, np.integer):
        raise ValueError("counts must be whole numbers, a row for each pixel and a column for each bin")
    if given.size and given.min() < 0:
        raise ValueError("counts must not be negative")


def prior_gains(bins: Bins, share_levels: int) -> Array:
    """What the tail tells of each bin's log gain.

    n fragments with an optical depth d together, behind D' of D: they show as much as they cover of what is still seen,
    `2 log(1 - exp(-d)) - 2 D'`, which n share; a fragment alone in its bin is in the right place but for the steps in
    which shares are kept.

    Args:
        bins: Of P pixels.
        share_levels: Of the tail.

    Returns:
        float32 [P, bins]; that of an empty bin means nothing.
    """
    whole = np.asarray(bins.optical_depth, dtype=np.float32)
    ends = np.ones((len(whole), np.shape(bins.counts)[1] + 1), dtype=np.float32)
    ends[:, 0], ends[:, 1:-1] = 0.0, bins.front
    before = whole[:, None] * ends
    own = np.maximum(before[:, 1:] - before[:, :-1], np.float32(0.0))
    n = np.maximum(np.asarray(bins.counts, dtype=np.float32), np.float32(1.0))
    covered = np.maximum(np.float32(1.0) - np.exp(-own), np.float32(LEAST_COVERED))
    alone = np.clip(whole * np.float32(0.5 / share_levels), LEAST_ALONE, MOST_ALONE).astype(np.float32)
    gain = np.float32(2.0) * (np.log(covered) - before[:, :-1]) - np.log(n)
    gain += np.where(n == 1.0, np.float32(2.0) * np.log(alone)[:, None], np.float32(0.0))
    return np.asarray(np.maximum(gain, np.float32(LEAST_PRIOR)), dtype=np.float32)


def gain_ranks(answers: Array, bins: Bins, share_levels: int) -> NDArray[np.uint8]:
    """Ranks of a network of the head `bin-gains`.

    Args:
        answers: float32 [P, bins + 1], the gains and the prior's weight; NaN, of a network that overflowed, is last.
        bins: Of the same pixels.
        share_levels: Of the tail.

    Returns:
        uint8 [P, bins], for `allocate`.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        price = -(answers[:, :-1] + answers[:, -1:] * prior_gains(bins, share_levels))
    return ranks_of(np.asarray(price, dtype=np.float32), bins.counts)


def importance_ranks(importance: NDArray[np.floating], counts: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Ranks of a network of the head `importance`: `t w - .5` is the middle of a bin's fragments at the scale t.

    Args:
        importance: [P], w, 0 to 1, or NaN, of a network that overflowed: that is none.
        counts: int [P, bins].

    Returns:
        uint8 [P, bins], for `allocate`.
    """
    given = np.asarray(counts, dtype=np.float32)
    middle = np.cumsum(given, axis=1) - np.float32(0.5) * given
    # Of NaN and another number, fmax is the other.
    weight = np.fmax(np.asarray(importance, dtype=np.float32), np.float32(LEAST_IMPORTANCE))
    scale = (middle + np.float32(0.5)) / weight[:, None]
    return ranks_of(np.asarray(np.float32(2.0) * np.log(scale), dtype=np.float32), counts)


def ranks_of(prices: Array, counts: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Ranks of prices, uint8 [P, bins]: an empty bin has that of the bins in front of it, and NaN is last.

    Args:
        prices: float32 [P, bins], negated log gain per fragment.
        counts: Integers [P, bins], fragments of each bin.
    """
    with np.errstate(over="ignore"):
        steps = (prices - np.float32(LEAST_PRICE)) * np.float32(PRICE_STEPS)
    last = np.float32(RANKS - 1)
    ranks = np.floor(np.fmax(np.fmin(steps + np.float32(0.5), last), np.float32(0.0)))
    ranks = np.where(np.asarray(counts) > 0, np.where(np.isnan(steps), last, ranks), np.float32(0.0))
    return np.maximum.accumulate(ranks, axis=1).astype(np.uint8)
