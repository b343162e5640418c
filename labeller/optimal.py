"""The Lagrangian optimum of an allocation, with a certificate (METHOD section 3).

All pixels share one price `lambda` per fragment: each goes along its hull while a step saves more than that.
The steps are selected over all pixels by their slopes until the budget is used; what is left over (less than one
step) is spent by the best single upgrades that fit, on the curves themselves. For any `lambda >= 0`,
`sum_p min_k (e_p(k) + lambda k) - lambda F` is a lower bound of the error of every allocation within F.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from labeller.allocation import Allocation
from labeller.curves import Curves
from labeller.greedy import Removals
from labeller.hull import Hulls
from labeller.selection import Selector, ascending_keys

_CANDIDATES: Final = 4096  # pixels that compete for the remainder; all of them in small views
_CLOSED: Final = 1e-6  # relative gap above which the greedy rules are tried as well


class LagrangianAllocator:
    """Optimal allocations of a view for any number of budgets with the same k_min.

    Args:
        curves: Error curves of the view.
        hulls: Their lower hulls.
    """

    def __init__(self, curves: Curves, hulls: Hulls) -> None:
        self._curves, self._hulls = curves, hulls
        self._slopes = hulls.slopes()
        self._least = np.minimum(curves.counts, hulls.k_min).astype(np.int32)
        self._selector = Selector(ascending_keys(-self._slopes), hulls.lengths())

    def allocate(self, budget: int) -> Allocation:
        """The best allocation found within the budget, with its bound.

        Args:
            budget: F, at least `sum min(k_min, n)`.
        """
        hulls = self._hulls
        spend = budget - int(self._least.sum(dtype=np.int64))
        end = self._selector.threshold(spend)
        k = self._least.copy()
        left = _climb(hulls.offsets, hulls.k, self._selector.keys, end.key, spend - end.below, k)
        if end.key >> 32:
            error = self._curves.total(k)
            return self._certified(budget, k, error, error, 0.0)
        lam = float(self._slopes[np.flatnonzero(self._selector.keys == end.key)[0]])
        k = self._upgrade(k, left)
        error, bound = self._curves.total(k), self._dual(lam, budget)
        if error - bound > _CLOSED * error:
            k = self._best_of(k, budget)
            error = self._curves.total(k)
        return self._certified(budget, k, error, bound, lam)

    def _certified(self, budget: int, k: NDArray[np.int32], error: float, bound: float, lam: float) -> Allocation:
        bound = max(min(bound, error), 0.0)  # they may cross by the rounding of the sums
        gap = (error - bound) / error if error > 0.0 else 0.0
        used = int(k.sum(dtype=np.int64))
        return Allocation("optimal", budget, k, used, error, self._hulls.k_min, False, bound, gap, lam)

    def _dual(self, lam: float, budget: int) -> float:
        """Value of the dual function at a price: a lower bound of the error within the budget."""
        k = self._least.copy()
        _cheapest(self._hulls.offsets, self._hulls.k, self._hulls.error, lam, k)
        return self._curves.total(k) + lam * (int(k.sum(dtype=np.int64)) - budget)

    def _best_of(self, k: NDArray[np.int32], budget: int) -> NDArray[np.int32]:
        """Where one step weighs much (few pixels, or next to no error), a greedy rule may have been luckier."""
        tried = [k, Removals(self._curves, self._hulls.k_min, "greedy").keep(budget)]
        tried.append(Removals(self._curves, self._hulls.k_min, "increment").keep(budget))
        return min(tried, key=self._curves.total)

    def _upgrade(self, k: NDArray[np.int32], left: int) -> NDArray[np.int32]:
        """Spend what is left: repeatedly the upgrade of one pixel that fits and saves most per fragment.

        Or the one upgrade that saves most in all, if that is better than all of those together.
        """
        if left <= 0:
            return k
        offsets, error = self._curves.offsets, self._curves.error
        rate, saving = np.zeros(len(k)), np.zeros(len(k))
        _upgrades(offsets, error, k, left, rate, saving)
        best = np.arange(len(k))
        if len(best) > _CANDIDATES:
            best = np.sort(np.argpartition(rate, -_CANDIDATES)[-_CANDIDATES:])
        many, one = k.copy(), k.copy()
        _spend(offsets, error, best, left, many)
        _spend_at_once(offsets, error, int(np.argmax(saving)), left, one)
        return min(many, one, key=self._curves.total)


@njit(cache=True)
def _climb(
    offsets: NDArray[np.int64],
    vertex: NDArray[np.int32],
    keys: NDArray[np.uint32],
    threshold: int,
    left: int,
    k: NDArray[np.int32],
) -> int:
    """Take all steps below the threshold, and those equal to it that fit, by pixel index; what is left."""
    for p in range(len(k)):
        for i in range(offsets[p], offsets[p + 1]):
            key = np.int64(keys[i])
            if key > threshold:
                break
            if key == threshold:
                cost = vertex[i] - k[p]
                if cost > left:
                    break
                left -= cost
            k[p] = vertex[i]
    return left


@njit(parallel=True, cache=True, error_model="numpy")
def _cheapest(
    offsets: NDArray[np.int64],
    vertex: NDArray[np.int32],
    error: NDArray[np.float32],
    lam: float,
    k: NDArray[np.int32],
) -> None:
    for p in prange(len(k)):
        least = np.inf
        for i in range(offsets[p], offsets[p + 1]):
            cost = np.float64(error[i]) + lam * vertex[i]
            if cost < least:
                least = cost
                k[p] = vertex[i]


@njit(cache=True, error_model="numpy")
def _best_step(
    offsets: NDArray[np.int64], error: NDArray[np.float32], p: int, k: int, left: int
) -> tuple[float, int, float, int]:
    """Largest saving per fragment and its cost, largest saving and its cost, of at most `left` more fragments."""
    first, n = offsets[p], offsets[p + 1] - offsets[p] - 1
    here = np.float64(error[first + k])
    rate, rate_cost, saving, saving_cost = 0.0, 0, 0.0, 0
    for cost in range(1, min(left, n - k) + 1):
        saved = here - np.float64(error[first + k + cost])
        if saved > saving:
            saving, saving_cost = saved, cost
        if saved / cost > rate:
            rate, rate_cost = saved / cost, cost
    return rate, rate_cost, saving, saving_cost


@njit(parallel=True, cache=True)
def _upgrades(
    offsets: NDArray[np.int64],
    error: NDArray[np.float32],
    k: NDArray[np.int32],
    left: int,
    rate: NDArray[np.float64],
    saving: NDArray[np.float64],
) -> None:
    for p in prange(len(k)):
        best = _best_step(offsets, error, p, k[p], left)
        rate[p], saving[p] = best[0], best[2]


@njit(cache=True)
def _spend(
    offsets: NDArray[np.int64], error: NDArray[np.float32], pixels: NDArray[np.int64], left: int, k: NDArray[np.int32]
) -> None:
    rates, costs = np.zeros(len(pixels)), np.zeros(len(pixels), dtype=np.int64)
    for i in range(len(pixels)):
        rates[i], costs[i], _, _ = _best_step(offsets, error, pixels[i], k[pixels[i]], left)
    while left > 0:
        best = -1
        for i in range(len(pixels)):
            if costs[i] > left:
                rates[i], costs[i], _, _ = _best_step(offsets, error, pixels[i], k[pixels[i]], left)
            if rates[i] > 0.0 and (best < 0 or rates[i] > rates[best]):
                best = i
        if best < 0:
            return
        k[pixels[best]] += costs[best]
        left -= costs[best]
        rates[best], costs[best], _, _ = _best_step(offsets, error, pixels[best], k[pixels[best]], left)


@njit(cache=True)
def _spend_at_once(
    offsets: NDArray[np.int64], error: NDArray[np.float32], p: int, left: int, k: NDArray[np.int32]
) -> None:
    k[p] += _best_step(offsets, error, p, k[p], left)[3]
