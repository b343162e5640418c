"""Is every certificate true, and every gap closed? Checked from the curves alone, not from what made the allocation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from labeller.allocation import Allocation
from labeller.curves import Curves, error_curves
from labeller.rules import allocate_curves
from schemas.fragments import FragmentDump

FACTORS: Final = (1, 2, 4)
"""Budgets as multiples of W H."""
SHARES: Final = (0.25, 0.4, 0.6, 0.8)
"""Budgets as shares of N."""
MOST_GAP: Final = 1e-4
_LEAST_ERROR: Final = 1e-9
"""A pixel: gaps are relative to this where the error is less (it is far below what 8 bits can show)."""
_ROUNDING: Final = 1e-12
"""Relative; of float64 sums over millions of pixels."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """One budget of one view.

    Attributes:
        budget: F.
        name: The budget in words.
        fragments: N.
        exact: Whether F >= N, so that nothing was decided.
        proven: Whether the labeller says that there is no better allocation at all.
        error: Of the optimal allocation.
        bound: Lower bound of any allocation's error, computed anew from the curves.
        gap: `(error - bound) / max(error, 1e-9 a pixel)`.
        greedy: Error of rule `greedy` over that of `optimal`; None where that has none.
        increment: The same of rule `increment`.
        wrong: What is not as it has to be.
    """

    budget: int
    name: str
    fragments: int
    exact: bool
    proven: bool
    error: float
    bound: float
    gap: float
    greedy: float | None
    increment: float | None
    wrong: tuple[str, ...]


def budgets_of(dump: FragmentDump) -> dict[str, int]:
    """The budgets of a view, by name."""
    return {
        **{f"{factor} W H": factor * dump.pixels for factor in FACTORS},
        **{f"{100 * share:.0f} % of N": int(share * dump.total) for share in SHARES},
    }


def certify(dump: FragmentDump) -> Iterator[Verdict]:
    """Every budget of a view."""
    curves = error_curves(dump)
    names = budgets_of(dump)
    budgets = list(names.values())
    found = [allocate_curves(dump, curves, budgets, rule) for rule in ("optimal", "greedy", "increment")]
    for name, *allocations in zip(names, *found, strict=True):
        yield judge(dump, curves, name, *allocations)


def judge(
    dump: FragmentDump, curves: Curves, name: str, optimal: Allocation, greedy: Allocation, increment: Allocation
) -> Verdict:
    """What can be said of three allocations of the same budget.

    Args:
        dump: Fragments of the view.
        curves: Its error curves.
        name: The budget in words.
        optimal: By rule `optimal`.
        greedy: By rule `greedy`.
        increment: By rule `increment`.
    """
    others = {"greedy": greedy, "increment": increment}
    wrong = [line for allocation in (optimal, *others.values()) for line in _illegal(dump, curves, allocation)]
    error, claimed = optimal.error, optimal.bound
    bound = 0.0 if optimal.exact else dual(curves, optimal.lam or 0.0, optimal.budget)
    # Above the dual bound there is only a proof that nothing better exists; then the error itself is the bound.
    highest = error if optimal.proven else bound
    if claimed is None or claimed > highest + _ROUNDING * (error + (optimal.lam or 0.0) * optimal.budget):
        wrong.append(f"a bound of {claimed} is claimed, the curves give {bound}")
    gap = max(error - bound, 0.0) / max(error, _LEAST_ERROR * dump.pixels)
    if gap > MOST_GAP and not optimal.proven:  # few pixels: the optimum itself lies that far above the dual bound
        wrong.append(f"a gap of {gap:.2e}")
    for rule, other in others.items():
        if error > other.error * (1.0 + _ROUNDING):
            wrong.append(f"an error of {error}, {rule} has {other.error}")
    ratios = {rule: other.error / error if error > 0.0 else None for rule, other in others.items()}
    return Verdict(
        optimal.budget,
        name,
        dump.total,
        optimal.exact,
        optimal.proven,
        error,
        min(bound, error),
        gap,
        ratios["greedy"],
        ratios["increment"],
        tuple(wrong),
    )


def dual(curves: Curves, lam: float, budget: int) -> float:
    """`sum_p min_k (e_p(k) + lam k) - lam F` over all k from 0 to n: below the error of every allocation."""
    return float(_cheapest(curves.offsets, curves.error, lam).sum()) - lam * budget


def _illegal(dump: FragmentDump, curves: Curves, a: Allocation) -> list[str]:
    """Why an allocation is none, if it is not."""
    n, wrong = dump.counts, []
    if a.used != a.k.sum(dtype=np.int64) or a.used > a.budget:
        wrong.append(f"{a.rule} uses {a.k.sum(dtype=np.int64)}, says {a.used}, of {a.budget}")
    if bool(((a.k < 0) | (a.k > n)).any()):
        wrong.append(f"{a.rule} leaves 0..n")
    if a.exact != (a.budget >= dump.total) or abs(curves.total(a.k) - a.error) > _ROUNDING * a.error:
        wrong.append(f"{a.rule} says error {a.error}, exact {a.exact}; it is {curves.total(a.k)}")
    return wrong


@njit(parallel=True, cache=True, error_model="numpy")
def _cheapest(offsets: NDArray[np.int64], error: NDArray[np.float32], lam: float) -> NDArray[np.float64]:
    # Per pixel, for numpy's sum is pairwise: a running sum of a million values costs five digits.
    out = np.empty(len(offsets) - 1)
    for p in prange(len(offsets) - 1):
        first, n = offsets[p], offsets[p + 1] - offsets[p] - 1
        out[p] = np.inf
        for k in range(n + 1):
            out[p] = min(out[p], np.float64(error[first + k]) + lam * k)
    return out
