"""From weights to fragment counts that use a budget exactly.

`budget_fill` looks for the scale `t` at which the counts `clamp(floor(t w_p), 0, n_p)` sum to the budget. The counts do
not fall with `t`, in floating point too, so `t` is bracketed down to neighbouring float64 numbers; what is then still
missing goes to the pixels that grow at the upper one (they have the largest fractions), by pixel index. Sums are of
integers: results do not depend on the number of threads.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray


def budget_fill(weights: NDArray[np.floating], n: NDArray[np.integer], budget: int) -> NDArray[np.int32]:
    """Spend a budget in proportion to weights: floor, clamp to `[0, n]`, remainder by largest fraction.

    Args:
        weights: [P], >= 0 and finite. Pixels of weight 0 get fragments only once all others are full.
        n: [P], fragments of each pixel.
        budget: F >= 0, fragments to spend.

    Returns:
        int32 [P], k with `0 <= k <= n` and `sum k = min(F, sum n)`.

    Raises:
        ValueError: If a weight is negative or not finite, or if the budget is negative.
    """
    weights = _checked(weights)
    counts = np.asarray(n, dtype=np.int32)
    largest = float(weights.max(initial=0.0))
    # Weights below 1e-200 of the largest count as zero, so that no scale can overflow.
    scaled = weights / largest if largest > 0.0 else weights
    weighted = scaled > 1e-200
    if budget >= int(counts[weighted].sum()):
        rest = np.where(weighted, counts, 0).astype(np.int32)
        others = np.where(weighted, 0, counts).astype(np.int32)
        left = budget - int(rest.sum(dtype=np.int64))
        return rest + _fill(others, np.ones(len(counts)), left)
    return _fill(counts, np.where(weighted, scaled, 0.0), budget)


def paper_fill(weights: NDArray[np.floating], budget: int) -> NDArray[np.int32]:
    """Eq. 3 of DHOIT as printed, `floor(w / sum w * F)`: no clamp (k may exceed n), the remainder is lost.

    Args:
        weights: [P], >= 0 and finite.
        budget: F, fragments to spend.

    Returns:
        int32 [P], slots reserved for each pixel.

    Raises:
        ValueError: If a weight is negative or not finite.
    """
    weights = _checked(weights)
    total = float(weights.sum())
    return np.asarray(np.floor(weights * (budget / total if total > 0.0 else 0.0)), dtype=np.int32)


def _checked(weights: NDArray[np.floating]) -> NDArray[np.float64]:
    numbers = np.asarray(weights, dtype=np.float64)
    if len(numbers) and not (np.isfinite(numbers).all() and numbers.min() >= 0.0):
        raise ValueError("weights must be finite and not negative")
    return numbers


def _fill(n: NDArray[np.int32], rate: NDArray[np.float64], budget: int) -> NDArray[np.int32]:
    """Counts `clamp(floor(t rate), 0, n)` that sum to `min(budget, sum n)`, with what is missing at the best t."""
    total = int(n.sum(dtype=np.int64))
    if budget < 0:
        raise ValueError(f"a budget cannot be negative: {budget}")
    target = min(budget, total)
    low, high = _bracket(n, rate)
    low_sum, high_sum = 0, total
    # Bounds of where counts first grow above low, and last grew below high; they meet on ties.
    first, last = low, high
    interpolate = True
    while low_sum < target and last - first > 1e-14 * (abs(first) + abs(last)):
        # By turns: interpolation is fast on smooth counts, halving ends after 64 steps whatever the counts.
        share = (target - low_sum) / (high_sum - low_sum)
        middle = first + (last - first) * share if interpolate else _halfway(first, last)
        interpolate = not interpolate
        if not low < middle < high:
            middle = _halfway(low, high)
        if middle == low:
            break
        count = _count(n, rate, middle)
        above, below = middle, middle
        if count in (low_sum, high_sum):  # nothing changes here: jump to where something does
            above, below = _neighbours(n, rate, middle)
        if count <= target:
            low, low_sum, first = middle, count, max(first, min(above, high))
        else:
            high, high_sum, last = middle, count, min(last, max(below, low))
    k = _counts(n, rate, low)
    if low_sum < target:
        growth = _counts(n, rate, high) - k
        before = np.cumsum(growth, dtype=np.int64) - growth
        k += np.clip(target - low_sum - before, 0, growth).astype(np.int32)
    return k


def _halfway(low: float, high: float) -> float:
    """The middle of two float64 numbers in the order of such numbers; `low` if they are neighbours."""
    bits = np.array([low, high]).view(np.int64)
    ranks = [int(x) if x >= 0 else -(int(x) & (2**63 - 1)) for x in bits]
    middle = (ranks[0] + ranks[1]) // 2
    magnitude = np.array([abs(middle)], dtype=np.int64).view(np.float64)[0]
    return math.copysign(float(magnitude), middle)


@njit(inline="always")
def _at(n: int, rate: float, t: float) -> int:
    return int(min(max(np.floor(t * rate), 0.0), float(n)))


@njit(parallel=True, cache=True, error_model="numpy")
def _count(n: NDArray[np.int32], rate: NDArray[np.float64], t: float) -> int:
    total = 0
    for p in prange(len(n)):
        total += _at(n[p], rate[p], t)
    return total


@njit(parallel=True, cache=True, error_model="numpy")
def _neighbours(n: NDArray[np.int32], rate: NDArray[np.float64], t: float) -> tuple[float, float]:
    # The least number above t at which a count grows, and the greatest below at which one grew.
    above, below = np.inf, -np.inf
    for p in prange(len(n)):
        k = _at(n[p], rate[p], t)
        if rate[p] > 0.0 and k < n[p]:
            above = min(above, (k + 1) / rate[p])
        if rate[p] > 0.0 and k > 0:
            below = max(below, k / rate[p])
    return above, below


@njit(parallel=True, cache=True, error_model="numpy")
def _counts(n: NDArray[np.int32], rate: NDArray[np.float64], t: float) -> NDArray[np.int32]:
    k = np.empty(len(n), dtype=np.int32)
    for p in prange(len(n)):
        k[p] = _at(n[p], rate[p], t)
    return k


@njit(cache=True, error_model="numpy")
def _bracket(n: NDArray[np.int32], rate: NDArray[np.float64]) -> tuple[float, float]:
    # Values of t at which every pixel has its least, and its most; the slack is far above rounding.
    low, high = np.inf, -np.inf
    for p in range(len(n)):
        if n[p] > 0 and rate[p] > 0.0:
            slack = 1e-9 * (n[p] / rate[p])
            low = min(low, 1 / rate[p] - slack)
            high = max(high, n[p] / rate[p] + slack)
    return (low, high) if low <= high else (0.0, 0.0)
