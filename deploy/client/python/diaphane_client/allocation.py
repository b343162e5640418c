"""From a network's answers to fragment counts that use a budget exactly: what the renderer's passes do, in numpy.

`allocate` looks for `t = -log lambda` on the lattice of prices that the shaders search, and so finds the same counts to
the fragment; `fill` spends a budget in proportion to weights. METHOD section 4 has both rules.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

MOST_FRAGMENTS: Final = 60_000
"""Fragments of one pixel that can be kept."""

_SHIFT: Final = 9
"""Digits of float32 that prices do without."""
_LAST: Final = 115 << (23 - _SHIFT)
"""Index of the greatest price, 2^115: at the ends of the lattice every curve gives n and 0."""
_MOST_GAIN: Final = 2.0**100
_LEAST_DECAY: Final = 2.0**-12
_MOST_DECAY: Final = 2.0**98
"""Curves are clamped to these |a| and b, so that nothing overflows."""
_LEAST_WEIGHT: Final = 1e-200
"""Weights below this share of the largest count as zero."""


def allocate(
    a: NDArray[np.floating], b: NDArray[np.floating], n: NDArray[np.integer], F: int
) -> tuple[NDArray[np.int32], float]:
    """Counts of predicted gain curves at the one lambda that uses a budget.

    `k = clamp(floor(1.5 + (a - log lambda) / b), 0, n)`. What is left goes to the pixels that grow at the next lower
    lambda, by index.

    Args:
        a: [P], log gain of the first fragment.
        b: [P], decay of the log gain per fragment, > 0. Where a or b is NaN, of a network that overflowed, the pixel
            comes last: the least a, the greatest b.
        n: int [P], fragments of each pixel; at most `MOST_FRAGMENTS` of them are used.
        F: Fragments to spend.

    Returns:
        int32 [P] with `sum k = min(F, sum n)`, and log lambda: -inf where the budget covers everything.

    Raises:
        ValueError: An argument is not as described.
    """
    gain, decay = _numbers(a, n), _numbers(b, n)
    if (decay <= 0.0).any():
        raise ValueError("b must be positive")
    usable = _usable(n, F)
    if usable.sum() <= F:
        return usable.astype(np.int32), -math.inf
    # Of NaN and another number, fmin and fmax are the other.
    offset = np.fmin(np.fmax(gain, -_MOST_GAIN), _MOST_GAIN).astype(np.float32)
    slope = np.fmax(np.fmin(decay, _MOST_DECAY), _LEAST_DECAY).astype(np.float32)
    rate = np.float32(1.0) / slope

    def counts(index: int) -> NDArray[np.int64]:
        k = np.floor((offset + _price(index)) * rate + np.float32(1.5))
        return np.asarray(np.clip(k, np.float32(0.0), usable.astype(np.float32)), dtype=np.int64)

    low, high = -_LAST, _LAST  # the counts at low are within the budget, those at high are not
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if counts(middle).sum() <= F else (low, middle)
    return _spent(counts(low), counts(high), F).astype(np.int32), -float(_price(low))


def fill(weights: NDArray[np.floating], n: NDArray[np.integer], F: int) -> NDArray[np.int32]:
    """Counts in proportion to weights: floor, clamp to n, the remainder by largest fraction, then by index.

    Args:
        weights: [P], finite, >= 0. Pixels of weight 0 get fragments only once all others are full.
        n: int [P], as for `allocate`.
        F: Fragments to spend.

    Returns:
        int32 [P] with `sum k = min(F, sum n)`.

    Raises:
        ValueError: An argument is not as described.
    """
    shares = _numbers(weights, n)
    if not (np.isfinite(shares) & (shares >= 0.0)).all():
        raise ValueError("weights must be finite and not negative")
    usable = _usable(n, F)
    if usable.sum() <= F:
        return usable.astype(np.int32)
    # Weights of pixels without fragments take no part in what is small beside the largest.
    largest = shares[usable > 0].max()
    weighted = shares > _LEAST_WEIGHT * largest
    if usable[weighted].sum() <= F:
        k = np.where(weighted, usable, 0)
        k[~weighted] = _by_scale(np.ones(int(np.count_nonzero(~weighted))), usable[~weighted], F - int(k.sum()))
    else:
        k = np.zeros_like(usable)
        k[weighted] = _by_scale(shares[weighted] / largest, usable[weighted], F)
    return k.astype(np.int32)


def _by_scale(shares: NDArray[np.float64], n: NDArray[np.int64], left: int) -> NDArray[np.int64]:
    """`min(floor(scale * shares), n)` at the largest scale within a budget, and the next one for the rest."""

    def counts(bits: int) -> NDArray[np.int64]:
        scale = np.array([bits]).view(np.float64)[0]
        return np.asarray(np.minimum(np.floor(scale * shares), n), dtype=np.int64)

    # Float64 numbers that are not negative have the order of their bits.
    enough = np.array([2.0 * float((n / shares).max(initial=1.0))])
    low, high = 0, int(enough.view(np.int64)[0])
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if counts(middle).sum() <= left else (low, middle)
    return _spent(counts(low), counts(high), left)


def _spent(k: NDArray[np.int64], more: NDArray[np.int64], left: int) -> NDArray[np.int64]:
    """Counts that grow from k towards more, by index, until they sum to a budget."""
    growth = more - k
    before = np.cumsum(growth) - growth
    return np.asarray(k + np.clip(left - int(k.sum()) - before, 0, growth), dtype=np.int64)


def _price(index: int) -> np.float32:
    """The t of an index from -_LAST to _LAST: does not fall with it, and is 0 at 0."""
    bits = np.array([0x3F800000 + (abs(index) << _SHIFT)], dtype=np.uint32)
    magnitude = bits.view(np.float32)[0] - np.float32(1.0)
    return np.float32(-magnitude if index < 0 else magnitude)


def _usable(n: NDArray[np.integer], F: int) -> NDArray[np.int64]:
    counts = np.asarray(n)
    if counts.ndim != 1 or not np.issubdtype(counts.dtype, np.integer) or (len(counts) and counts.min() < 0):
        raise ValueError("n must be a row of counts")
    if F < 0:
        raise ValueError("the budget must not be negative")
    return np.minimum(counts.astype(np.int64), MOST_FRAGMENTS)


def _numbers(values: NDArray[np.floating], n: NDArray[np.integer]) -> NDArray[np.float64]:
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.shape != np.shape(n):
        raise ValueError("there must be one number for each pixel")
    return numbers
