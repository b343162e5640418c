"""Allocating fragment budgets over the pixels of a view, by any rule (METHOD section 3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labeller.allocation import Allocation, RuleName, measured
from labeller.baselines import FillName, fixed, weighted
from labeller.curves import Curves
from labeller.greedy import Removals
from labeller.hull import Hulls, lower_hulls
from labeller.optimal import LagrangianAllocator
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
    if any(budget < 0 for budget in budgets):
        raise ValueError("a budget cannot be negative")
    n = dump.counts
    makers: dict[int, Callable[[int], Allocation]] = {}
    results = []
    for budget in budgets:
        least = min(k_min, feasible_k_min(n, budget))
        if budget >= dump.total:
            results.append(_everything(rule, budget, n, least))
            continue
        if least not in makers:
            makers[least] = _maker(dump, curves, rule, least, hulls, vkb, fill)
        results.append(makers[least](budget))
    return results


def _everything(rule: RuleName, budget: int, n: NDArray[np.int64], k_min: int) -> Allocation:
    k, used = n.astype(np.int32), int(n.sum())
    if rule == "optimal":
        return Allocation(rule, budget, k, used, 0.0, k_min, True, 0.0, 0.0, 0.0)
    return Allocation(rule, budget, k, used, 0.0, k_min, True)


def _maker(
    dump: FragmentDump,
    curves: Curves,
    rule: RuleName,
    k_min: int,
    hulls: Hulls | None,
    vkb: VkbOptions,
    fill: FillName,
) -> Callable[[int], Allocation]:
    """What turns a budget (with this k_min, below N) into an allocation."""
    if rule == "optimal":
        fits = hulls is not None and hulls.k_min == k_min
        return LagrangianAllocator(curves, hulls if hulls is not None and fits else lower_hulls(curves, k_min)).allocate
    counts: Callable[[int], NDArray[np.int32]]
    if rule in ("greedy", "increment"):
        counts = Removals(curves, k_min, "greedy" if rule == "greedy" else "increment").keep
    elif rule in ("fixed", "dynamic"):
        one_k = fixed if rule == "fixed" else dynamic

        def counts(budget: int) -> NDArray[np.int32]:
            return one_k(dump.counts, budget)
    else:
        assert rule in ("importance", "uniform", "proportional")

        def counts(budget: int) -> NDArray[np.int32]:
            return weighted(dump, rule, budget, k_min, vkb, fill)

    return lambda budget: measured(rule, budget, counts(budget), curves, k_min)
