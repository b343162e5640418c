"""The few pixels around the price of a Lagrangian allocation, solved exactly (METHOD section 3, the remainder).

Choosing one k per pixel within a budget is a multiple-choice knapsack. At a price `lambda`, choosing k at pixel p loses
`r_p(k) = e_p(k) + lambda k - min_j (e_p(j) + lambda j) >= 0`, and an unspent fragment loses lambda: an allocation's
error is the dual bound plus the sum of its losses. What loses more than the best allocation known so far can be in no
better one. What is left after that is small (a "core": Balas and Zemel 1980, for this problem Pisinger 1995) and is
searched by dynamic programming over the fragments by which the pixels differ from where they stand.

Where many pixels are alike, few of them are enough. Pixels of one solution whose changes cancel could as well stay
where they are. Changes of at most D fragments each can be put in an order in which their sums stay between -D and D,
or what is left; so sums repeat, and some changes cancel, if there are more than `2 D + left` of them. A solution
changes no more pixels than that, and of all pixels that could change by the same number only so many are looked at.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

_STATES: Final = 1 << 22  # of all pixels together, 4 bytes each
_WORK: Final = 1 << 27  # steps of the dynamic programming
_SLACK: Final = 1e-12  # of sums that were added up in another order
_ROUNDING: Final = 1e-15  # of a loss, relative to the price of the fragments that it is about


class Core(NamedTuple):
    """Pixels that may differ from the Lagrangian allocation.

    Attributes:
        offsets: int64 [C+1], where their curves begin.
        error: float32 [E], their curves, from k = 0.
        base: int32 [C], where they stand.
    """

    offsets: NDArray[np.int64]
    error: NDArray[np.float32]
    base: NDArray[np.int32]


class Solution(NamedTuple):
    """Core fragments of the core's pixels.

    Attributes:
        k: int32 [C].
        loss: Loss of the core's pixels and of what stays unspent.
        complete: Whether no allocation of the core loses less.
    """

    k: NDArray[np.int32]
    loss: float
    complete: bool


def solve_core(core: Core, lam: float, left: int) -> Solution:
    """The best that can be made of a remainder by changing the core's pixels.

    Args:
        core: The pixels.
        lam: Price of a fragment, > 0.
        left: Fragments that are not spent, >= 0.
    """
    loss = _losses(core, lam)
    k = core.base.copy()
    spent = _spend(core, left, k)
    best = _total(core, loss, k) + lam * (left - spent)
    pixels, first, last, changes = _participants(core, loss, best, left)
    reach = changes * int(max(last.max(initial=0), -first.min(initial=0)))
    complete = True
    # Too much work: only those that lose least, so that what can be done is done.
    while len(pixels) and not _affordable(first, last, reach):
        complete = False
        half = len(pixels) // 2
        pixels, first, last = pixels[:half], first[:half], last[:half]
    found, improved = _search(core, loss, lam, left, (pixels, first, last), reach, best)
    if improved < best * (1.0 - _SLACK):
        return Solution(found, improved, complete)
    return Solution(k, best, complete)


Changes = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]
"""Pixels of a core, and the least and the greatest change of k of each that could be part of a better solution."""


def _participants(
    core: Core, loss: NDArray[np.float64], best: float, left: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], int]:
    """Pixels with a change that loses less than `best`, those of the least loss first; how many may change at once."""
    here = core.offsets[:-1] + core.base
    least, first, last = np.empty(len(here)), *np.empty((2, len(here)), dtype=np.int64)
    _alternatives(core, loss, best, least, first, last)
    moves = least < best
    most = int(max(last.max(initial=0), -first.min(initial=0)))
    astray = moves & (loss[here] > 0.0)  # a change of these may gain by itself
    changes = 2 * most + left + 1 + int(astray.sum()) * (most + 1)
    if int(moves.sum()) > changes:
        needed = astray.copy()
        for change in range(-most, most + 1):
            candidates = np.flatnonzero(moves & (first <= change) & (change <= last)) if change else here[:0]
            if len(candidates) > changes:
                lost = loss[here[candidates] + change]
                limit = np.partition(lost, changes - 1)[changes - 1]
                below, equal = candidates[lost < limit], candidates[lost == limit]
                candidates = np.concatenate([below, equal[: changes - len(below)]])
            needed[candidates] = True
        moves &= needed
    pixels = np.flatnonzero(moves)
    pixels = pixels[np.argsort(least[pixels], kind="stable")]
    return pixels, first[pixels], last[pixels], min(changes, len(pixels))


def _affordable(first: NDArray[np.int64], last: NDArray[np.int64], reach: int) -> bool:
    width = min(int(-first.sum()), reach) + min(int(last.sum()), reach) + 1
    return len(first) * width <= _STATES and int((last - first + 1).sum()) * width <= _WORK


@njit(cache=True, error_model="numpy")
def _losses(core: Core, lam: float) -> NDArray[np.float64]:
    # By differences from the cheapest k: next to the whole cost of a long list, small losses would be lost.
    loss = np.empty(len(core.error))
    for c in range(len(core.base)):
        begin, end = core.offsets[c], core.offsets[c + 1]
        cheapest = begin
        for i in range(begin + 1, end):
            if np.float64(core.error[i]) - np.float64(core.error[cheapest]) + lam * (i - cheapest) < 0.0:
                cheapest = i
        for i in range(begin, end):
            price = lam * (i - cheapest)
            lost = np.float64(core.error[i]) - np.float64(core.error[cheapest]) + price
            loss[i] = lost if lost > _ROUNDING * abs(price) else 0.0
    return loss


@njit(cache=True)
def _total(core: Core, loss: NDArray[np.float64], k: NDArray[np.int32]) -> float:
    total = 0.0
    for c in range(len(k)):
        total += loss[core.offsets[c] + k[c]]
    return total


@njit(cache=True, error_model="numpy")
def _spend(core: Core, left: int, k: NDArray[np.int32]) -> int:
    """Greedily: the upgrades that save most per fragment and fit, one a pixel; or the one that saves most in all."""
    rates, costs = np.zeros(len(k)), np.zeros(len(k), dtype=np.int64)
    largest, pixel, cost = np.float64(0.0), -1, 0
    for c in range(len(k)):
        first = core.offsets[c] + core.base[c]
        for more in range(1, min(left, core.offsets[c + 1] - 1 - first) + 1):
            saved = np.float64(core.error[first]) - np.float64(core.error[first + more])
            if saved / more > rates[c]:
                rates[c], costs[c] = saved / more, more
            if saved > largest:
                largest, pixel, cost = saved, c, more
    spent, gained = 0, 0.0
    for c in np.argsort(-rates):
        if rates[c] <= 0.0:
            break
        if costs[c] <= left - spent:
            k[c] += costs[c]
            spent += costs[c]
            gained += rates[c] * costs[c]
    if gained >= largest:
        return spent
    k[:] = core.base
    k[pixel] += cost
    return cost


@njit(cache=True)
def _alternatives(
    core: Core,
    loss: NDArray[np.float64],
    best: float,
    least: NDArray[np.float64],
    first: NDArray[np.int64],
    last: NDArray[np.int64],
) -> None:
    # `first` and `last`: the smallest and the largest change of k that loses less than `best`; 0 is among them.
    for c in range(len(core.base)):
        base = core.offsets[c] + core.base[c]
        least[c], first[c], last[c] = np.inf, 0, 0
        for i in range(core.offsets[c], core.offsets[c + 1]):
            if i != base and loss[i] < best:
                least[c] = min(least[c], loss[i])
                first[c], last[c] = min(first[c], i - base), max(last[c], i - base)


@njit(cache=True, error_model="numpy")
def _search(
    core: Core,
    loss: NDArray[np.float64],
    lam: float,
    left: int,
    changes: Changes,
    reach: int,
    best: float,
) -> tuple[NDArray[np.int32], float]:
    """Least loss over changes of some pixels whose sums stay within `reach` either way, and the counts that have it."""
    pixels, first, last = changes
    down = min(-first.sum(), reach)
    width = down + min(last.sum(), reach) + 1
    states, following = np.full(width, np.inf), np.full(width, np.inf)
    chosen = np.zeros((len(pixels), width), dtype=np.int32)
    states[down] = _total(core, loss, core.base)
    for c in pixels:
        states[down] -= loss[core.offsets[c] + core.base[c]]
    states[down] = max(states[down], 0.0)
    low, high = down, down
    for j in range(len(pixels)):
        base = core.offsets[pixels[j]] + core.base[pixels[j]]
        following[max(low + first[j], 0) : min(high + last[j], width - 1) + 1] = np.inf
        for change in range(first[j], last[j] + 1):
            lost = loss[base + change]
            if lost > best:
                continue
            for d in range(max(low, -change), min(high, width - 1 - change) + 1):
                total = states[d] + lost
                if total <= best and total < following[d + change]:
                    following[d + change] = total
                    chosen[j, d + change] = change
        low, high = max(low + first[j], 0), min(high + last[j], width - 1)
        states, following = following, states
    end, least = -1, np.inf
    for d in range(low, min(high, down + left) + 1):
        total = states[d] + lam * (down + left - d)
        if total < least:
            end, least = d, total
    k = core.base.copy()
    if end >= 0:
        for j in range(len(pixels) - 1, -1, -1):
            k[pixels[j]] += chosen[j, end]
            end -= chosen[j, end]
    return k, least
