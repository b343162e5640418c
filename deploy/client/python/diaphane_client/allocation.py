"""From a network's answers to the whole bins that are every pixel's core: what the renderer's passes do, in numpy.

METHOD section 4 has the rule. Arithmetic is float32, operation by operation, and sums are of integers, so that the cuts
are those of the shaders to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from diaphane_client.constants import (
    DROPPED_BITS,
    FULL,
    LEAST_FALL,
    LEAST_PRICE,
    MOST_BINS,
    MOST_CORE,
    MOST_FALL,
    MOST_GAIN,
    RANKS,
)

_BITS_OF_ONE: Final = 0x3F800000
"""Of float32."""


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


def allocate(a: NDArray[np.floating], b: NDArray[np.floating], counts: NDArray[np.integer], F: int) -> Cuts:
    """Whole bins of predicted gain curves at the one price that uses a budget.

    A cut of N fragments after one of M is worth it from the price `b ((M + N) / 2 - 1) - a` on. What is left at the
    price goes to the pixels that grow at the next rank of prices, by index; the first that does not fit takes those of
    its bins that do.

    Args:
        a: [P], log gain of the first fragment.
        b: [P], fall of the log gain per fragment, > 0. Where a or b is NaN, of a network that overflowed, the pixel
            comes last: the least a, the greatest b.
        counts: int [P, bins], fragments in each depth bin; 255 for that many or more, which are never in a core.
        F: Fragments to spend.

    Raises:
        ValueError: An argument is not as described.
    """
    growth = _usable(counts, F)
    gain, fall = _numbers(a, len(growth)), _numbers(b, len(growth))
    if (fall <= 0.0).any():
        raise ValueError("b must be positive")
    grows = growth > 0
    if growth.sum() <= F:
        return _cuts(growth, grows, complete=True)
    rank = _ranks(*_within_limits(gain, fall), growth)
    spent = np.cumsum(np.bincount(rank[grows], weights=growth[grows], minlength=RANKS)).astype(np.int64)
    chosen = int(np.searchsorted(spent, F, side="right"))
    granted, more = grows & (rank < chosen), grows & (rank == chosen)
    # Pixel by pixel, in each bin by bin: up to the first of them that does not fit.
    fits = np.cumsum((growth * more).ravel()) <= F - int((growth * granted).sum())
    return _cuts(growth, granted | (more & fits.reshape(more.shape)), complete=False)


def importance_curve(importance: NDArray[np.floating]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Importances as curves whose k at a price t is nearest to `t w - .5`, for `allocate`.

    Args:
        importance: [P], 0 to 1, or NaN, of a network that overflows: that is none.

    Returns:
        float32 [P], a and b.
    """
    # Of NaN and another number, fmax is the other.
    weight = np.fmax(np.asarray(importance, dtype=np.float32), np.float32(1.0 / MOST_FALL))
    fall = np.asarray(np.float32(1.0) / weight, dtype=np.float32)
    return np.asarray(np.maximum(np.float32(-1.5) * fall, np.float32(-MOST_GAIN)), dtype=np.float32), fall


def _within_limits(
    gain: NDArray[np.float32], fall: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    gain = np.fmin(np.fmax(gain, np.float32(-MOST_GAIN)), np.float32(MOST_GAIN))
    return gain, np.fmax(np.fmin(fall, np.float32(MOST_FALL)), np.float32(LEAST_FALL))


def _ranks(gain: NDArray[np.float32], fall: NDArray[np.float32], growth: NDArray[np.int64]) -> NDArray[np.int64]:
    """Ranks of the prices of all cuts, [P, bins], from 0 to RANKS - 1: the upper bits of float32, above LEAST_PRICE."""
    after = np.cumsum(growth, axis=1)
    steps = np.float32(0.5) * (2 * after - growth).astype(np.float32) - np.float32(1.0)
    price = fall[:, None] * steps - gain[:, None]
    above = np.maximum(price - np.float32(LEAST_PRICE), np.float32(1.0))
    return np.asarray(np.minimum(above.view(np.uint32).astype(np.int64) - _BITS_OF_ONE >> DROPPED_BITS, RANKS - 1))


def _cuts(growth: NDArray[np.int64], granted: NDArray[np.bool_], *, complete: bool) -> Cuts:
    cut = (np.arange(1, growth.shape[1] + 1) * granted).max(axis=1, initial=0)
    return Cuts(cut.astype(np.int32), (growth * granted).sum(axis=1).astype(np.int32), complete)


def _usable(counts: NDArray[np.integer], F: int) -> NDArray[np.int64]:
    """int64 [P, bins], fragments of the bins that can be in a core; 0 from the first one on that cannot."""
    given = np.asarray(counts)
    if given.ndim != 2 or not 1 <= given.shape[1] <= MOST_BINS or not np.issubdtype(given.dtype, np.integer):
        raise ValueError("counts must be whole numbers, a row for each pixel and a column for each bin")
    if given.size and given.min() < 0:
        raise ValueError("counts must not be negative")
    if F < 0:
        raise ValueError("the budget must not be negative")
    own = np.minimum(given, FULL).astype(np.int64)
    fits = (own < FULL) & (np.cumsum(own, axis=1) <= MOST_CORE)
    return np.asarray(np.where(np.logical_and.accumulate(fits, axis=1), own, 0))


def _numbers(values: NDArray[np.floating], pixels: int) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):  # what is beyond float32 is infinite, and then within the limits
        numbers = np.asarray(values, dtype=np.float32)
    if numbers.shape != (pixels,):
        raise ValueError("there must be one number for each pixel")
    return numbers
