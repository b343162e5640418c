"""Charts of a benchmark: time and memory against error, and errors within a budget, scene by scene."""

from __future__ import annotations

from collections.abc import Sequence

from evaluation.bench.groups import ORACLE_WORDS, Group, Row, group, measured, offline, plain_tail
from evaluation.report.dots import Dot, error_dots
from evaluation.report.fronts import MEMORY, TIME, Cost, Point, error_chart
from evaluation.report.vega import Spec
from evaluation.summary import EXACT


def specifications(groups: Sequence[Group]) -> dict[str, Spec]:
    """Name of a file, without its suffix -> chart. Those of costs are over the views of all groups."""
    views = [view for each in groups for view in each.views]
    whole = groups[0] if len(groups) == 1 else group("All of them", views)
    factors = sorted({cell.budget_factor for view in views for cell in view.cells if cell.budget_factor})
    made = {"time-error": cost_chart(whole, TIME), "error-bytes": cost_chart(whole, MEMORY)}
    made |= {f"figure6-{factor:g}": budget_chart(groups, factor) for factor in factors}
    return {name: spec for name, spec in made.items() if spec is not None}


def cost_chart(shown: Group, cost: Cost) -> Spec | None:
    """A cost against error, at equal fragments; None where nothing was measured."""
    rows = [*measured(shown.rows, "none"), *measured(shown.rows, "fragments")]
    points = [point for row in rows if (point := _point(row, cost))]
    return error_chart(points, shown.title, cost)


def budget_chart(groups: Sequence[Group], factor: float) -> Spec | None:
    """DHOIT's Figure 6: error of every technique on every scene, the bounded ones within F = `factor` WH.

    None where no bounded technique has an error.
    """
    dots = [dot for each in groups for dot in _dots(each, factor)]
    return error_dots(dots, f"Squared error within F = {factor:g} WH, by scene and technique")


def _point(row: Row, cost: Cost) -> Point | None:
    value = cost.of(row)
    if not value or (row.mse is None and row.family != "exact"):
        return None
    return Point(
        row.key.technique,
        row.key.budget_factor,
        value,
        row.mse or 0.0,
        plain_tail(row.key),
        row.is_runnable,
        f"mean over {row.averaged} of {row.views} views" if row.mse and row.averaged < row.views else "",
    )


def _dots(each: Group, factor: float) -> list[Dot]:
    rows = [row for row in measured(each.rows, "fragments") if row.key.budget_factor == factor]
    if not any(row.mse is not None for row in rows):
        return []
    free = measured(each.rows, "none")
    # Their pictures are the same: one stands for all.
    rows += [
        *sorted((row for row in free if row.family == "exact"), key=lambda row: row.key.technique != EXACT)[:1],
        *[row for row in free if row.mse is not None],
    ]
    dots = [
        Dot(each.title, row.key.technique, row.mse or 0.0, plain_tail(row.key))
        for row in rows
        if row.mse is not None or row.family == "exact"
    ]
    dots += [
        Dot(each.title, ORACLE_WORDS, mark.mse)
        for mark in offline(each)
        if mark.budget_factor == factor and mark.gap is None
    ]
    return dots
