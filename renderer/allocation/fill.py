"""From weights or predicted gain curves to fragment counts that use a budget exactly.

Both fills look for one scalar `t` at which the counts `clamp(floor(c + (a_p + t) m_p), k_min, n_p)` sum to the
budget: `budget_fill` with `t` the scale of the weights, `solve_lambda` with `t = -log lambda`. The counts do
not fall with `t`, in floating point too, so `t` is bracketed down to neighbouring float64 numbers; what is then
still missing goes to the pixels that grow at the upper one (they have the largest fractions), by pixel index.
Sums are of integers: results do not depend on the number of threads.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray


def feasible_k_min(n: NDArray[np.integer], budget: int) -> int:
    """1 where the budget covers one fragment for every occupied pixel, else 0 (METHOD section 3)."""
    return int(budget >= np.count_nonzero(n))


def budget_fill(weights: NDArray[np.floating], n: NDArray[np.integer], budget: int, k_min: int) -> NDArray[np.int32]:
    """Spend a budget in proportion to weights: floor, clamp to `[k_min, n]`, remainder by largest fraction.

    Args:
        weights: [P], >= 0 and finite. Pixels of weight 0 get more than `k_min` only once all others are full.
        n: [P], fragments of each pixel.
        budget: F, fragments to spend.
        k_min: 0 or 1; pixels with fewer fragments keep what they have.

    Returns:
        int32 [P], k with `min(k_min, n) <= k <= n` and `sum k = min(F, sum n)`.

    Raises:
        ValueError: If a weight is negative or not finite, or if the budget is below `sum min(k_min, n)`.
    """
    weights = _checked(weights)
    counts = np.asarray(n, dtype=np.int32)
    largest = float(weights.max(initial=0.0))
    # Weights below 1e-200 of the largest count as zero, so that no scale can overflow.
    scaled = weights / largest if largest > 0.0 else weights
    weighted = scaled > 1e-200
    spendable = budget - int(np.minimum(counts[~weighted], k_min).sum())
    if spendable >= int(counts[weighted].sum()):
        rest = np.where(weighted, counts, 0).astype(np.int32)
        others = np.where(weighted, 0, counts).astype(np.int32)
        left = budget - int(rest.sum(dtype=np.int64))
        return rest + _fill(others, np.zeros(1), np.ones(len(counts)), 0.0, left, k_min)[0]
    return _fill(counts, np.zeros(1), np.where(weighted, scaled, 0.0), 0.0, budget, k_min)[0]


def solve_lambda(
    a: NDArray[np.floating], b: NDArray[np.floating], n: NDArray[np.integer], budget: int, k_min: int
) -> tuple[NDArray[np.int32], float]:
    """The counts of predicted gain curves at the one `lambda` that uses a budget (METHOD section 4).

    `k_p(lambda) = clamp(floor(1.5 + (a_p - log lambda) / b_p), k_min, n_p)`.

    Args:
        a: [P], log gain of the first fragment; finite.
        b: [P], decay of the log gain per fragment; finite, > 0.
        n: [P], fragments of each pixel.
        budget: F, fragments to spend.
        k_min: 0 or 1; pixels with fewer fragments keep what they have.

    Returns:
        int32 [P] with `sum k = min(F, sum n)`, and `log lambda` at which `sum k(lambda) <= F` is largest; what
        is missing there goes to the pixels that grow at the next smaller lambda, by pixel index.

    Raises:
        ValueError: If a value is not finite, a `b` is not positive, or the budget is below `sum min(k_min, n)`.
    """
    gain, decay = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if not (np.isfinite(gain).all() and np.isfinite(decay).all() and decay.min(initial=1.0) > 0.0):
        raise ValueError("gain curves must be finite, with positive decay")
    k, t = _fill(np.asarray(n, dtype=np.int32), gain, 1.0 / np.maximum(decay, 1e-12), 1.5, budget, k_min)
    return k, -t


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


def _fill(
    n: NDArray[np.int32], a: NDArray[np.float64], m: NDArray[np.float64], c: float, budget: int, k_min: int
) -> tuple[NDArray[np.int32], float]:
    """Counts that sum to `min(budget, sum n)`, and the largest `t` whose own counts do not exceed that.

    `a` has one entry per pixel, or one for all.
    """
    total, least = int(n.sum(dtype=np.int64)), int(np.minimum(n, k_min).sum(dtype=np.int64))
    if budget < least:
        raise ValueError(f"a budget of {budget} is below the {least} fragments that k_min = {k_min} takes")
    target = min(budget, total)
    low, high = _bracket(n, a, m, c, k_min)
    low_sum, high_sum = least, total
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
        count = _count(n, a, m, c, middle, k_min)
        above, below = middle, middle
        if count in (low_sum, high_sum):  # nothing changes here: jump to where something does
            above, below = _neighbours(n, a, m, c, middle, k_min)
        if count <= target:
            low, low_sum, first = middle, count, max(first, min(above, high))
        else:
            high, high_sum, last = middle, count, min(last, max(below, low))
    k = _counts(n, a, m, c, low, k_min)
    if low_sum < target:
        growth = _counts(n, a, m, c, high, k_min) - k
        before = np.cumsum(growth, dtype=np.int64) - growth
        k += np.clip(target - low_sum - before, 0, growth).astype(np.int32)
    return k, low


def _halfway(low: float, high: float) -> float:
    """The middle of two float64 numbers in the order of such numbers; `low` if they are neighbours."""
    bits = np.array([low, high]).view(np.int64)
    ranks = [int(x) if x >= 0 else -(int(x) & (2**63 - 1)) for x in bits]
    middle = (ranks[0] + ranks[1]) // 2
    magnitude = np.array([abs(middle)], dtype=np.int64).view(np.float64)[0]
    return math.copysign(float(magnitude), middle)


@njit(inline="always")
def _at(n: int, a: float, m: float, c: float, t: float, k_min: int) -> int:
    return int(min(max(np.floor(c + (a + t) * m), float(min(k_min, n))), float(n)))


@njit(parallel=True, cache=True, error_model="numpy")
def _count(n: NDArray[np.int32], a: NDArray[np.float64], m: NDArray[np.float64], c: float, t: float, k_min: int) -> int:
    total = 0
    step = int(len(a) > 1)
    for p in prange(len(n)):
        total += _at(n[p], a[p * step], m[p], c, t, k_min)
    return total


@njit(parallel=True, cache=True, error_model="numpy")
def _neighbours(
    n: NDArray[np.int32], a: NDArray[np.float64], m: NDArray[np.float64], c: float, t: float, k_min: int
) -> tuple[float, float]:
    # The least number above t at which a count grows, and the greatest below at which one grew.
    above, below = np.inf, -np.inf
    step = int(len(a) > 1)
    for p in prange(len(n)):
        offset, rate = a[p * step], m[p]
        k = _at(n[p], offset, rate, c, t, k_min)
        if rate > 0.0 and k < n[p]:
            above = min(above, (k + 1 - c) / rate - offset)
        if rate > 0.0 and k > k_min:
            below = max(below, (k - c) / rate - offset)
    return above, below


@njit(parallel=True, cache=True, error_model="numpy")
def _counts(
    n: NDArray[np.int32], a: NDArray[np.float64], m: NDArray[np.float64], c: float, t: float, k_min: int
) -> NDArray[np.int32]:
    k = np.empty(len(n), dtype=np.int32)
    step = int(len(a) > 1)
    for p in prange(len(n)):
        k[p] = _at(n[p], a[p * step], m[p], c, t, k_min)
    return k


@njit(cache=True, error_model="numpy")
def _bracket(
    n: NDArray[np.int32], a: NDArray[np.float64], m: NDArray[np.float64], c: float, k_min: int
) -> tuple[float, float]:
    # Values of t at which every pixel has its least, and its most; the slack is far above rounding.
    low, high = np.inf, -np.inf
    step = int(len(a) > 1)
    for p in range(len(n)):
        if n[p] > k_min and m[p] > 0.0:
            slack = 1e-9 * (n[p] / m[p] + abs(a[p * step]))
            low = min(low, (k_min + 1 - c) / m[p] - a[p * step] - slack)
            high = max(high, (n[p] - c) / m[p] - a[p * step] + slack)
    return (low, high) if low <= high else (0.0, 0.0)
