"""Allocations of a view that comes in row bands, for more fragments than memory holds.

What a budget needs of all pixels together is one threshold; it is found from histograms that add up over the bands. So
the bands are gone through several times (once to count, twice for the threshold, once for the result), each time
with only one of them and its curves in memory. The results are those of the whole view.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from labeller.allocation import Allocation
from labeller.api import budgets_of
from labeller.curves import Curves, error_curves
from labeller.descent import Part, part_of
from labeller.error_rules import ErrorRule, allocate_by_error
from labeller.hull import lower_hulls
from labeller.rules import each_budget
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem
from schemas.tail import DEFAULT_TAIL, DENSITY_G, MetricName, TailName


def allocate_bands(
    bands: Callable[[], Iterable[FragmentDump]],
    budgets: Iterable[int] | int,
    rule: ErrorRule = "optimal",
    *,
    tail: TailName = DEFAULT_TAIL,
    g: float = DENSITY_G,
    metric: MetricName = "display",
) -> list[Allocation]:
    """Core fragments of every pixel, for each budget; memory is that of one band and of the results.

    Args:
        bands: Gives the bands from top to bottom; called about five times, and has to give the same ones each time.
        budgets: Fragment counts F >= 0, in any order.
        rule: `optimal`, `greedy` or `increment`.
        tail: Tail that stands for the fragments beyond k.
        g: Steepness of the density tail.
        metric: Space of the error.

    Returns:
        One allocation for each budget, in the order of `budgets`; k is that of all bands, one after the other.

    Raises:
        Problem: If a band is malformed, if a budget is no integer or negative, or if the rule is not one of the three.
    """
    if rule not in get_args(ErrorRule):
        rules = ", ".join(get_args(ErrorRule))
        raise Problem(f"The rule '{rule}' does not work band by band.", f"Use one of {rules}.", ExitCode.USAGE)
    counts = [np.empty(0, dtype=np.int32), *(band.counts.astype(np.int32) for band in bands())]
    n: NDArray[np.int32] = np.concatenate(counts)

    def curves() -> Iterator[Curves]:
        return (error_curves(band, tail, g, metric) for band in bands())

    def short(wanted: list[int]) -> list[Allocation]:
        def parts() -> Iterator[Part]:
            return (part_of(part, lower_hulls(part)) for part in curves())

        return allocate_by_error(rule, wanted, int(np.count_nonzero(n)), curves, parts, keep=False)

    return each_budget(n, budgets_of(budgets), rule, short)
