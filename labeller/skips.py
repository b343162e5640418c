"""What labelling leaves out because its result is known without it, and how much that is (METHOD.md section 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from labeller.hull import Hulls
from schemas.fragments import FragmentDump
from schemas.skips import COMPLETE_BUDGETS, EXACT_PIXELS, REPEATED_BUDGETS


def pixel_skips(dump: FragmentDump, hulls: Hulls) -> dict[str, int]:
    """Pixels with fragments that take no part in allocations: they are exact without a core fragment.

    Args:
        dump: Fragments of a view.
        hulls: Hulls of its error curves.
    """
    return {EXACT_PIXELS: int(np.count_nonzero((dump.counts > 0) & (np.diff(hulls.offsets) == 0)))}


def needed_budgets(budgets: Sequence[int], total: int) -> tuple[int, ...]:
    """The budgets that an allocation has to be computed for: each once, ascending, below the fragments there are.

    Args:
        budgets: F, in any order.
        total: N.
    """
    return tuple(sorted({budget for budget in budgets if budget < total}))


def budget_skips(budgets: Sequence[int], total: int) -> dict[str, int]:
    """Budgets that `needed_budgets` leaves out."""
    below = [budget for budget in budgets if budget < total]
    return {COMPLETE_BUDGETS: len(budgets) - len(below), REPEATED_BUDGETS: len(below) - len(set(below))}
