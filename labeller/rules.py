"""Allocating fragment budgets over the pixels of a view, by any rule (METHOD section 3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labeller.allocation import Allocation, RuleName, measured
from labeller.baselines import FillName, fixed, weighted
from labeller.curves import Curves
from labeller.descent import Part, part_of
from labeller.error_rules import allocate_by_error
from labeller.hull import Hulls, lower_hulls
from renderer.allocation.dynamic import dynamic
from renderer.allocation.importance import VkbOptions
from schemas.fragments import FragmentDump

_VKB: Final = VkbOptions()


def allocate_curves(
    dump: FragmentDump,
    curves: Curves,
    budgets: Sequence[int],
    rule: RuleName,
    hulls: Hulls | None = None,
    vkb: VkbOptions = _VKB,
    fill: FillName = "exact",
) -> list[Allocation]:
    """Core fragments of every pixel, for each budget. Budgets share everything that does not depend on them.

    Args:
        dump: Fragments of a view.
        curves: Its error curves.
        budgets: Fragment counts F >= 0, in any order. F >= N gives k = n, flagged `exact`.
        rule: One of `labeller.allocation.RULES`.
        hulls: The curves' hulls, if the caller has them (rule `optimal`); else they are made here.
        vkb: Factors of rule `importance`.
        fill: How the rules `importance`, `uniform` and `proportional` come from weights to counts.

    Returns:
        One allocation for each budget, in the order of `budgets`.

    Raises:
        ValueError: If a budget is negative.
    """
    n = dump.counts

    def short(wanted: list[int]) -> list[Allocation]:
        return _short(dump, curves, wanted, rule, hulls, vkb, fill)

    return each_budget(n, budgets, rule, short)


def each_budget(
    n: NDArray[np.integer],
    budgets: Sequence[int],
    rule: RuleName,
    short: Callable[[list[int]], list[Allocation]],
) -> list[Allocation]:
    """Allocations in the order of the budgets; those below N are made together, equal ones once.

    Args:
        n: [P], fragments of each pixel.
        budgets: F, in any order.
        rule: Rule that makes them.
        short: Makes the allocations of budgets below N, of which no two are equal.

    Raises:
        ValueError: If a budget is negative.
    """
    if any(budget < 0 for budget in budgets):
        raise ValueError("a budget cannot be negative")
    total = int(n.sum(dtype=np.int64))
    results = {budget: _everything(rule, budget, n) for budget in budgets if budget >= total}
    below = [budget for budget in dict.fromkeys(budgets) if budget < total]
    results |= {made.budget: made for made in (short(below) if below else ())}
    return [results[budget] for budget in budgets]


def _everything(rule: RuleName, budget: int, n: NDArray[np.integer]) -> Allocation:
    k, used = n.astype(np.int32), int(n.sum(dtype=np.int64))
    if rule == "optimal":
        return Allocation(rule, budget, k, used, 0.0, True, 0.0, 0.0, 0.0, True)
    return Allocation(rule, budget, k, used, 0.0, True)


def _short(
    dump: FragmentDump,
    curves: Curves,
    budgets: Sequence[int],
    rule: RuleName,
    hulls: Hulls | None,
    vkb: VkbOptions,
    fill: FillName,
) -> list[Allocation]:
    """Allocations of budgets below N."""
    if rule in ("optimal", "greedy", "increment"):
        parts: tuple[Part, ...] = ()
        if rule == "optimal":
            parts = (part_of(curves, lower_hulls(curves) if hulls is None else hulls),)
        occupied = int(np.count_nonzero(dump.counts))
        return allocate_by_error(rule, budgets, occupied, lambda: (curves,), lambda: parts, keep=True)
    if rule in ("fixed", "dynamic"):
        counts = [(fixed if rule == "fixed" else dynamic)(dump.counts, budget) for budget in budgets]
    else:
        assert rule in ("importance", "uniform", "proportional")
        counts = [weighted(dump, rule, budget, vkb, fill) for budget in budgets]
    return [measured(rule, F, k, curves) for F, k in zip(budgets, counts, strict=True)]
