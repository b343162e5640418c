"""Whole bins within a budget: what `renderer/shaders/allocation` does, in numpy.

A pixel's core is all fragments of its first bins: its *cut* is how many bins. How many fragments that are is known
before any is captured, so capturing them is an append. A predicted gain curve `log gain(k) = a - b (k - 1)` says at
which price each cut becomes the nearest to the k that the curve asks for: with `k = 1 + (a + t) / b` at the price
`t = -log lambda`, the cut of N fragments after one of M is nearer from `t = b ((M + N) / 2 - 1) - a` on.

So a frame has events, each a price and the fragments that come with it, and the price that uses a budget is the last
one up to which all of them fit: a selection by one count of 4,096 ranks of prices, not a search. What is then left goes
to the pixels that grow at the next rank, by index, and the first that does not fit takes those of its bins that do:
`sum k <= F`, met up to one bin of one pixel.
Within a rank gains differ by a few per cent, so that which of them grow says little.

All arithmetic is float32, operation by operation, and every sum is of integers: the shaders give the same to the bit.
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
RANKS: Final = 4096
"""Of prices, as they are told apart."""
LEAST_PRICE: Final = -8.0
"""Prices up to 1 above it are one rank."""
DROPPED_BITS: Final = 15
"""Lowest bits of float32 that a price's rank does without, above LEAST_PRICE: prices from 8 to 24 are 1/16 apart."""
_BITS_OF_ONE: Final = 0x3F800000
MOST_GAIN: Final = 2.0**60
LEAST_FALL: Final = 2.0**-12
MOST_FALL: Final = 2.0**60
"""Curves are clamped to these |a| and b; a trained network stays far within."""


@dataclass(frozen=True, slots=True)
class Events:
    """Cuts of every pixel, in order, as they become worth it.

    Attributes:
        rank: int64 [P, B], of the price from which bin b is in the core, rising with b; that of a bin that adds nothing
            or cannot be in a core means nothing.
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


def within_limits(a: NDArray[np.floating], b: NDArray[np.floating]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What a network answered, as numbers that can be ranked.

    A network of finite weights can overflow, and answer infinity or, as a difference of such, NaN. NaN says nothing of
    a pixel, so that it comes last: the least gain, the fastest fall. `kbuffer-deep/curves.comp` has it so, too.

    Args:
        a: [P], log gain of the first fragment.
        b: [P], fall of the log gain per fragment, > 0 or NaN.

    Returns:
        float32 [P] each: |a| <= MOST_GAIN, LEAST_FALL <= b <= MOST_FALL.
    """
    with np.errstate(over="ignore"):
        gain, fall = np.asarray(a, dtype=np.float32), np.asarray(b, dtype=np.float32)
    # Of NaN and another number, fmin and fmax are the other.
    gain = np.fmin(np.fmax(gain, np.float32(-MOST_GAIN)), np.float32(MOST_GAIN))
    return gain, np.fmax(np.fmin(fall, np.float32(MOST_FALL)), np.float32(LEAST_FALL))


def importance_curve(importance: NDArray[np.floating]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Importances as curves: `b = 1 / w` and `a = -1.5 b` ask for `k = t w - .5`, as Eq. 3 of DHOIT with a scale t.

    Args:
        importance: [P], 0 to 1, or NaN, of a network that overflows: that is none.
    """
    weight = np.fmax(np.asarray(importance, dtype=np.float32), np.float32(1.0 / MOST_FALL))
    fall = np.float32(1.0) / weight
    return within_limits(np.float32(-1.5) * fall, fall)


def rank_of(price: NDArray[np.float32]) -> NDArray[np.int64]:
    """Ranks of prices: whole numbers that do not fall as prices rise, 0 to RANKS - 1."""
    above = np.maximum(np.asarray(price, dtype=np.float32) - np.float32(LEAST_PRICE), np.float32(1.0))
    bits = np.ascontiguousarray(above).view(np.uint32).astype(np.int64)
    return np.asarray(np.minimum(bits - _BITS_OF_ONE >> DROPPED_BITS, RANKS - 1))


def usable_counts(counts: NDArray[np.integer]) -> NDArray[np.int64]:
    """Fragments of the bins that can be in a core, int64 [P, B]; 0 from the first bin on that cannot.

    Args:
        counts: [P, B], fragments of each bin, FULL for that many or more.
    """
    given = np.asarray(counts, dtype=np.int64)
    fits = (given < FULL) & (np.cumsum(given, axis=1) <= MOST_CORE)
    return np.where(np.logical_and.accumulate(fits, axis=1), given, 0)


def events_of(a: NDArray[np.floating], b: NDArray[np.floating], counts: NDArray[np.integer]) -> Events:
    """What the pixels ask for at which price.

    Args:
        a: [P], log gain of the first fragment.
        b: [P], fall of the log gain per fragment.
        counts: [P, B], fragments of each bin.
    """
    gain, fall = within_limits(a, b)
    growth = usable_counts(counts)
    after = np.cumsum(growth, axis=1)
    middle = np.float32(0.5) * (2 * after - growth).astype(np.float32)
    price = fall[:, None] * (middle - np.float32(1.0)) - gain[:, None]
    return Events(rank_of(price), growth)


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
