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
from renderer.allocation.fill import feasible_k_min
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
    k_min: int = 1,
) -> list[Allocation]:
    """Core fragments of every pixel, for each budget. Budgets share everything that does not depend on them.

    Args:
        dump: Fragments of a view.
        curves: Its error curves.
        budgets: Fragment counts F >= 0, in any order. F >= N gives k = n, flagged `exact`.
        rule: One of `labeller.allocation.RULES`.
        hulls: The curves' hulls, if the caller has them (rule `optimal`); made here for another k_min.
        vkb: Factors of rule `importance`.
        fill: How the rules `importance`, `uniform` and `proportional` come from weights to counts.
        k_min: Fewest fragments of an occupied pixel: 1 (or 0, where a budget does not cover that), or always 0.

    Returns:
        One allocation for each budget, in the order of `budgets`.

    Raises:
        ValueError: If a budget is negative.
    """
    n = dump.counts

    def short(wanted: list[int], least: int) -> list[Allocation]:
        return _short(dump, curves, wanted, rule, least, hulls, vkb, fill)

    return each_budget(n, budgets, rule, k_min, short)


def each_budget(
    n: NDArray[np.integer],
    budgets: Sequence[int],
    rule: RuleName,
    k_min: int,
    short: Callable[[list[int], int], list[Allocation]],
) -> list[Allocation]:
    """Allocations in the order of the budgets; those below N that share k_min are made together, equal ones once.

    Args:
        n: [P], fragments of each pixel.
        budgets: F, in any order.
        rule: Rule that makes them.
        k_min: 0 or 1; where a budget does not cover 1 it is 0.
        short: Makes the allocations of budgets below N, of which no two are equal, with a k_min that they cover.

    Raises:
        ValueError: If a budget is negative.
    """
    if any(budget < 0 for budget in budgets):
        raise ValueError("a budget cannot be negative")
    total = int(n.sum(dtype=np.int64))
    results: dict[int, Allocation] = {}
    wanted: dict[int, list[int]] = {0: [], 1: []}
    for budget in dict.fromkeys(budgets):
        least = min(k_min, feasible_k_min(n, budget))
        if budget >= total:
            results[budget] = _everything(rule, budget, n, least)
        else:
            wanted[least].append(budget)
    for least, below in wanted.items():
        results.update((made.budget, made) for made in (short(below, least) if below else ()))
    return [results[budget] for budget in budgets]


def _everything(rule: RuleName, budget: int, n: NDArray[np.integer], k_min: int) -> Allocation:
    k, used = n.astype(np.int32), int(n.sum(dtype=np.int64))
    if rule == "optimal":
        return Allocation(rule, budget, k, used, 0.0, k_min, True, 0.0, 0.0, 0.0, True)
    return Allocation(rule, budget, k, used, 0.0, k_min, True)


def _short(
    dump: FragmentDump,
    curves: Curves,
    budgets: Sequence[int],
    rule: RuleName,
    k_min: int,
    hulls: Hulls | None,
    vkb: VkbOptions,
    fill: FillName,
) -> list[Allocation]:
    """Allocations of budgets below N that share k_min."""
    if rule in ("optimal", "greedy", "increment"):
        parts: tuple[Part, ...] = ()
        if rule == "optimal":
            fits = hulls is not None and hulls.k_min == k_min
            parts = (part_of(curves, hulls if hulls is not None and fits else lower_hulls(curves, k_min)),)
        return allocate_by_error(rule, budgets, k_min, lambda: (curves,), lambda: parts, keep=True)
    if rule in ("fixed", "dynamic"):
        counts = [(fixed if rule == "fixed" else dynamic)(dump.counts, budget) for budget in budgets]
    else:
        assert rule in ("importance", "uniform", "proportional")
        counts = [weighted(dump, rule, budget, k_min, vkb, fill) for budget in budgets]
    return [measured(rule, F, k, curves, k_min) for F, k in zip(budgets, counts, strict=True)]
