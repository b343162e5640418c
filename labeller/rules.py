"""Allocating fragment budgets over the pixels of a view, by any rule (METHOD section 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from labeller.allocation import Allocation, RuleName, measured
from labeller.baselines import FillName, fixed, weighted
from labeller.curves import Curves
from labeller.descent import part_of
from labeller.greedy import RemovalName, Removals, removal_keys
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
    least = [min(k_min, feasible_k_min(n, budget)) for budget in budgets]
    results = {F: _everything(rule, F, n, m) for F, m in zip(budgets, least, strict=True) if dump.total <= F}
    for m in (0, 1):
        short = [F for F, k in zip(budgets, least, strict=True) if k == m and F not in results]
        made = _short(dump, curves, short, rule, m, hulls, vkb, fill) if short else []
        results.update((found.budget, found) for found in made)
    return [results[budget] for budget in budgets]


def _everything(rule: RuleName, budget: int, n: NDArray[np.int64], k_min: int) -> Allocation:
    k, used = n.astype(np.int32), int(n.sum())
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
    if rule == "optimal":
        part = part_of(curves, hulls if hulls is not None and hulls.k_min == k_min else lower_hulls(curves, k_min))
        found = LagrangianAllocator(lambda: (part,), k_min).allocate(budgets)
        return [x if x.proven else _better_of(x, curves) for x in found]
    counts: list[NDArray[np.int32]]
    if rule in ("greedy", "increment"):
        counts = _removed(curves, k_min, "greedy" if rule == "greedy" else "increment", budgets)
    elif rule in ("fixed", "dynamic"):
        counts = [(fixed if rule == "fixed" else dynamic)(dump.counts, budget) for budget in budgets]
    else:
        assert rule in ("importance", "uniform", "proportional")
        counts = [weighted(dump, rule, budget, k_min, vkb, fill) for budget in budgets]
    return [measured(rule, F, k, curves, k_min) for F, k in zip(budgets, counts, strict=True)]


def _better_of(found: Allocation, curves: Curves) -> Allocation:
    """An allocation that is not proven, or that of a greedy rule which was luckier with the remainder."""
    names: tuple[RemovalName, ...] = ("greedy", "increment")
    for name in names:
        (k,) = _removed(curves, found.k_min, name, [found.budget])
        error = curves.total(k)
        if error < found.error:
            bound = found.bound or 0.0
            found = replace(found, k=k, used=int(k.sum()), error=error, gap=(error - bound) / error if error else 0.0)
    return found


def _removed(curves: Curves, k_min: int, name: RemovalName, budgets: Sequence[int]) -> list[NDArray[np.int32]]:
    keys = removal_keys(curves, k_min, name)
    return Removals(lambda: (keys,)).keep(budgets)
