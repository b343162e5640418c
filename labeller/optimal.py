"""The optimal allocation of a view, with a certificate (METHOD section 3).

All pixels share one price `lambda` per fragment: each goes along its hull while a step saves more than that.
The steps are selected over all pixels by their slopes until the budget is used; what is left over (less than one
step) is a small problem among the pixels whose slopes are next to the price, and is solved exactly. For any
`lambda >= 0`, `sum_p min_k (e_p(k) + lambda k) - lambda F` is a lower bound of the error of every allocation within F;
where the small problem shows that nothing better exists, the error itself is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labeller.allocation import Allocation
from labeller.core_problem import Core, solve_core
from labeller.descent import Part, core_of, descend, slope_of
from labeller.selection import END, Histogram, Items, Threshold

_AROUND: Final = (512, 8192, 131072)
"""Fragments on either side of the threshold whose pixels compete for the remainder; more if that proves nothing."""
_PIXELS: Final = 1 << 16  # that compete, at most
_ERRORS: Final = 1 << 22  # of their curves, at most
_ULPS: Final = 8  # slopes are rounded to float32: a step this near to the price may be on its other side
_ROUNDED: Final = 1e-6  # the same, relative
_SUMS_ROUNDED: Final = 1e-13  # relative: error and bound are sums in float64


@dataclass(slots=True)
class _State:
    """What is known of one budget's allocation while the parts go by.

    Attributes:
        budget: F.
        end: Threshold of the steps.
        left: Fragments that are not spent.
        price: Slope of a step at the threshold, not rounded: steps that tie then lose exactly nothing.
        k: Of each part.
        error: Sums of errors of the pixels outside of the core.
        dual: Sums of errors at the dual's minima.
        dual_k: Fragments there.
        core: Of each part, the pixels that compete for the remainder and their curves.
        outside: How many pixels with steps are not in the window.
        whole: Whether the core has all pixels of the window.
    """

    budget: int
    end: Threshold
    left: int
    price: float = 0.0
    k: list[NDArray[np.int32]] = field(default_factory=list)
    error: list[float] = field(default_factory=list)
    dual: list[float] = field(default_factory=list)
    dual_k: int = 0
    core: list[tuple[NDArray[np.int64], Core]] = field(default_factory=list)
    outside: int = 0
    whole: bool = True


class LagrangianAllocator:
    """Optimal allocations of a view for any number of budgets.

    Args:
        parts: Gives the view's pixels, in one part or in several one after the other; called anew for each pass.
    """

    def __init__(self, parts: Callable[[], Iterable[Part]]) -> None:
        self._parts = parts
        self._histogram = Histogram((part.keys, part.lengths) for part in parts())

    def allocate(self, budgets: Sequence[int]) -> list[Allocation]:
        """The best allocation within each budget, with its bound.

        Args:
            budgets: F >= 0.
        """
        found: dict[int, Allocation] = {}
        open_ = list(dict.fromkeys(budgets))
        for around in _AROUND:
            states = self._descended(open_, around) if open_ else []
            for state in states:
                made, known = _finished(state), found.get(state.budget)
                if known is None or made.proven or made.error < known.error:
                    found[state.budget] = made
            # A window that has more pixels than can be looked at is not made larger.
            open_ = [state.budget for state in states if state.whole and not found[state.budget].proven]
        return [found[budget] for budget in budgets]

    def _descended(self, budgets: Sequence[int], around: int) -> list[_State]:
        def items() -> Iterable[Items]:
            return ((part.keys, part.lengths) for part in self._parts())

        ends = self._histogram.thresholds(budgets, items, around)
        states = [_State(budget, _widened(end), budget - end.below) for budget, end in zip(budgets, ends, strict=True)]
        for part in self._parts():
            for state in states:
                _go_on(state, part)
        return states


def _widened(end: Threshold) -> Threshold:
    if end.key == END:
        return end
    return replace(end, first=max(min(end.first, end.key - _ULPS), 0), last=max(end.last, end.key + _ULPS))


def _go_on(state: _State, part: Part) -> None:
    """One more part of the view."""
    here = descend(part, state.end, state.left)
    state.left -= here.spent
    state.price = state.price or here.slope
    state.k.append(here.k)
    state.error.extend(here.error)
    state.dual.extend(here.dual)
    state.dual_k += here.dual_k
    state.outside += here.outside
    room = _PIXELS - sum(len(pixels) for pixels, _ in state.core)
    ends = np.cumsum(part.curves.offsets[here.window + 1] - part.curves.offsets[here.window])
    taken = min(room, int(np.searchsorted(ends, _ERRORS, side="right")))
    chosen, others = here.window[:taken], here.window[taken:]
    state.core.append((chosen, core_of(part, chosen, here.k)))
    state.whole &= not len(others)
    state.error.append(float(part.curves.error[part.curves.offsets[others] + here.k[others]].sum(dtype=np.float64)))


def _finished(state: _State) -> Allocation:
    core, lam = _joined([core for _, core in state.core]), slope_of(state.end.key)
    core_k, proven = core.base, True
    if lam > 0.0:
        solution = solve_core(core, state.price, state.left)
        core_k = solution.k
        proven = state.whole and solution.complete and solution.loss <= _margin(state)
    error = math.fsum([*state.error, *core.error[core.offsets[:-1] + core_k].astype(np.float64)])
    # One exact sum: where nearly all steps of many pixels tie, the difference is far smaller than what it is of.
    dual = math.fsum([*state.dual, lam * (state.dual_k - state.budget)])
    proven |= dual >= error * (1.0 - _SUMS_ROUNDED)
    # Rounded down: the bound must not lie above the least error. Where nothing better exists, the error is it.
    bound = error if proven else min(max(dual * (1.0 - 1e-15), 0.0), error)
    begin = 0
    for k, (pixels, _) in zip(state.k, state.core, strict=True):
        k[pixels] = core_k[begin : begin + len(pixels)]
        begin += len(pixels)
    k = np.concatenate([np.empty(0, np.int32), *state.k]) if len(state.k) != 1 else state.k[0]
    gap = (error - bound) / error if error > 0.0 else 0.0
    used = int(k.sum(dtype=np.int64))
    return Allocation("optimal", state.budget, k, used, error, False, bound, gap, lam, proven)


def _margin(state: _State) -> float:
    """What a change of any pixel without a step in the window loses at least; 0 if that is lost in rounding."""
    if not state.outside:
        return math.inf
    end, lam = state.end, slope_of(state.end.key)
    above = slope_of(end.first) - lam if end.first else math.inf
    below = lam - slope_of(end.last) if end.last < END else math.inf
    return max(min(above, below) - _ROUNDED * lam, 0.0)


def _joined(cores: Sequence[Core]) -> Core:
    if len(cores) == 1:
        return cores[0]
    ends = np.cumsum([0, *(core.offsets[-1] for core in cores)])
    offsets = [core.offsets[:-1] + end for core, end in zip(cores, ends[:-1], strict=True)]
    return Core(
        np.concatenate([*offsets, ends[-1:]]).astype(np.int64),
        np.concatenate([np.empty(0, np.float32), *(core.error for core in cores)]),
        np.concatenate([np.empty(0, np.int32), *(core.base for core in cores)]),
    )
