"""The rules that look at errors (`optimal`, `greedy`, `increment`), for a view in one part or in row bands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from labeller.allocation import Allocation
from labeller.curves import Curves
from labeller.descent import Part
from labeller.greedy import RemovalKeys, RemovalName, Removals, removal_keys
from labeller.optimal import LagrangianAllocator

ErrorRule = Literal["optimal", "greedy", "increment"]
CurveParts = Callable[[], Iterable[Curves]]
"""Gives the curves of a view's pixels, part after part; called anew for each pass."""


def allocate_by_error(
    rule: ErrorRule,
    budgets: Sequence[int],
    k_min: int,
    curves: CurveParts,
    parts: Callable[[], Iterable[Part]],
    keep: bool,
) -> list[Allocation]:
    """Allocations of budgets below N.

    Args:
        rule: One of the three.
        budgets: F, at least `sum min(k_min, n)`.
        k_min: 0 or 1.
        curves: The view.
        parts: The same with hulls from `k_min` (rule `optimal`).
        keep: Whether what one pass makes of a part may stay in memory for the next.
    """
    if rule == "optimal":
        found = LagrangianAllocator(parts, k_min).allocate(budgets)
        return _never_above_greedy(found, k_min, curves, keep)
    return _removed(rule, budgets, k_min, curves, keep)


def _never_above_greedy(found: list[Allocation], k_min: int, curves: CurveParts, keep: bool) -> list[Allocation]:
    """Where an allocation is not proven, a greedy rule may have been luckier with the remainder."""
    best = {x.budget: x for x in found}
    unproven = [budget for budget, x in best.items() if not x.proven]
    names: tuple[RemovalName, ...] = ("greedy", "increment")
    for name in names if unproven else ():
        for other in _removed(name, unproven, k_min, curves, keep):
            known = best[other.budget]
            if other.error < known.error:
                gap = (other.error - (known.bound or 0.0)) / other.error if other.error > 0.0 else 0.0
                best[other.budget] = replace(known, k=other.k, used=other.used, error=other.error, gap=gap)
    return [best[x.budget] for x in found]


def _removed(rule: RemovalName, budgets: Sequence[int], k_min: int, curves: CurveParts, keep: bool) -> list[Allocation]:
    def keys() -> Iterable[RemovalKeys]:
        return (removal_keys(part, k_min, rule) for part in curves())

    kept = list(keys()) if keep else None
    counts = Removals(keys if kept is None else lambda: kept).keep(budgets)
    errors = np.zeros(len(budgets))
    first = 0
    for part in curves():
        after = first + len(part.offsets) - 1
        errors += [part.total(k[first:after]) for k in counts]
        first = after
    return [
        Allocation(rule, F, k, int(k.sum(dtype=np.int64)), float(error), k_min)
        for F, k, error in zip(budgets, counts, errors, strict=True)
    ]
