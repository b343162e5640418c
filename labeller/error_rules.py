"""The rules that look at errors (`optimal`, `greedy`, `increment`), for a view in one part or in row bands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from labeller.allocation import Allocation
from labeller.curves import Curves
from labeller.descent import Part
from labeller.greedy import RemovalKeys, RemovalName, Removals, least_kept, removal_keys
from labeller.optimal import LagrangianAllocator

ErrorRule = Literal["optimal", "greedy", "increment"]
CurveParts = Callable[[], Iterable[Curves]]
"""Gives the curves of a view's pixels, part after part; called anew for each pass."""


def allocate_by_error(
    rule: ErrorRule,
    budgets: Sequence[int],
    occupied: int,
    curves: CurveParts,
    parts: Callable[[], Iterable[Part]],
    keep: bool,
) -> list[Allocation]:
    """Allocations of budgets below N.

    Args:
        rule: One of the three.
        budgets: F, of which no two are equal.
        occupied: Pixels with fragments.
        curves: The view.
        parts: The same with hulls (rule `optimal`).
        keep: Whether what one pass makes of a part may stay in memory for the next.
    """
    if rule == "optimal":
        found = LagrangianAllocator(parts).allocate(budgets)
        return _never_above_greedy(found, occupied, curves, keep)
    return _removed(rule, budgets, occupied, curves, keep)


def _never_above_greedy(found: list[Allocation], occupied: int, curves: CurveParts, keep: bool) -> list[Allocation]:
    """Where an allocation is not proven, a greedy rule may have been luckier with the remainder."""
    best = {x.budget: x for x in found}
    unproven = [budget for budget, x in best.items() if not x.proven]
    names: tuple[RemovalName, ...] = ("greedy", "increment")
    for name in names if unproven else ():
        for other in _removed(name, unproven, occupied, curves, keep):
            known = best[other.budget]
            if other.error < known.error:
                gap = (other.error - (known.bound or 0.0)) / other.error if other.error > 0.0 else 0.0
                best[other.budget] = replace(known, k=other.k, used=other.used, error=other.error, gap=gap)
    return [best[x.budget] for x in found]


def _removed(
    rule: RemovalName, budgets: Sequence[int], occupied: int, curves: CurveParts, keep: bool
) -> list[Allocation]:
    together: dict[int, list[int]] = {}
    for budget in budgets:
        together.setdefault(least_kept(rule, occupied, budget), []).append(budget)
    made = {
        found.budget: found
        for least, several in together.items()
        for found in _removed_down_to(least, rule, several, curves, keep)
    }
    return [made[budget] for budget in budgets]


def _removed_down_to(
    least: int, rule: RemovalName, budgets: Sequence[int], curves: CurveParts, keep: bool
) -> list[Allocation]:
    def keys() -> Iterable[RemovalKeys]:
        return (removal_keys(part, least, rule) for part in curves())

    kept = list(keys()) if keep else None
    counts = Removals(keys if kept is None else lambda: kept).keep(budgets)
    errors = np.zeros(len(budgets))
    first = 0
    for part in curves():
        after = first + len(part.offsets) - 1
        errors += [part.total(k[first:after]) for k in counts]
        first = after
    return [
        Allocation(rule, F, k, int(k.sum(dtype=np.int64)), float(error))
        for F, k, error in zip(budgets, counts, errors, strict=True)
    ]
