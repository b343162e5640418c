"""What every allocation rule returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from labeller.curves import Curves

RuleName = Literal["greedy", "increment", "optimal", "fixed", "dynamic", "importance", "uniform", "proportional"]
RULES: tuple[RuleName, ...] = get_args(RuleName)


@dataclass(frozen=True, slots=True)
class Allocation:
    """Core fragments of every pixel of a view for one budget.

    Attributes:
        rule: Rule that made it.
        budget: F, fragments that could be spent.
        k: int32 [P], 0 <= k <= n.
        used: Sum of k, <= F.
        error: Sum of the squared errors e_p(k_p).
        exact: Whether the budget covers all fragments, so that nothing had to be decided: k = n, error 0.
        bound: Lower bound of the error of any allocation within the budget (rule `optimal`).
        gap: `(error - bound) / error`, 0 where the error is 0 (rule `optimal`).
        lam: Error saved per fragment at which the budget was used up (rule `optimal`); 0 if it was not.
        proven: Whether no allocation within the budget has less error: the bound is the error itself (rule `optimal`).
    """

    rule: RuleName
    budget: int
    k: NDArray[np.int32]
    used: int
    error: float
    exact: bool = False
    bound: float | None = None
    gap: float | None = None
    lam: float | None = None
    proven: bool = False


def measured(rule: RuleName, budget: int, k: NDArray[np.int32], curves: Curves) -> Allocation:
    """An allocation with its use and error, without a bound.

    Args:
        rule: Rule that made it.
        budget: F, fragments that could be spent.
        k: int32 [P], core fragments of each pixel, 0 <= k <= n.
        curves: Error curves of the view.
    """
    return Allocation(rule, budget, k, int(k.sum(dtype=np.int64)), curves.total(k))
