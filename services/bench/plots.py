"""Plots as Vega-Lite specifications with their data in them: time against error, error against bytes, error bars."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from services.bench.groups import Group, Row, measured, said_tail, said_technique
from services.report.charts import pareto_front

SCHEMA: Final = "https://vega.github.io/schema/vega-lite/v5.json"
_PANEL = {"width": 420, "height": 300}
_COLUMNS = 2
_POINT = {"type": "point", "filled": True, "size": 70, "opacity": 1.0}
_COLOUR = {"field": "name", "type": "nominal", "title": "technique", "scale": {"scheme": "tableau20"}}
"""A colour for each technique, whatever its tail: there are fewer of them than colours."""
_SHAPE = {"field": "tail", "type": "nominal", "title": "tail"}
"""Tells the tails of a technique apart."""


def specifications(groups: Sequence[Group]) -> dict[str, dict[str, Any]]:
    """File name -> specification. Means over the views of each scene, opacity and size."""
    return {
        "time-error.vl.json": _against(
            groups, "ms", "wall time of a frame, ms", lambda row: row.ms, "Wall time of a frame against squared error"
        ),
        "error-bytes.vl.json": _against(
            groups,
            "mib",
            "memory of all buffers, MiB",
            lambda row: None if row.total_bytes is None else row.total_bytes / 2**20,
            "Memory of all buffers against squared error",
        ),
        "figure6.vl.json": _bars(groups),
    }


def _against(
    groups: Sequence[Group], field: str, axis: str, cost: Callable[[Row], float | None], title: str
) -> dict[str, Any]:
    """Points of all techniques, those of one technique and tail joined, and the front of what a renderer can run."""
    points = [point for group in groups for point in _points(group, field, cost)]
    x = {"field": field, "type": "quantitative", "scale": {"type": "log"}, "title": axis}
    y = {"field": "mse", "type": "quantitative", "scale": {"type": "log"}, "title": "MSE ×1e-5"}
    has_error = {"filter": "datum.mse != null"}
    layers = [
        {
            "transform": [has_error],
            "mark": {"type": "line", "opacity": 0.4},
            "encoding": {"x": x, "y": y, "color": _COLOUR, "detail": {"field": "tail"}},
        },
        {
            # An error of 0 has no place on a logarithmic axis: what is exact is a line at its cost.
            "transform": [{"filter": "datum.family == 'exact'"}],
            "mark": {"type": "rule", "opacity": 0.6},
            "encoding": {"x": x, "color": _COLOUR, "tooltip": [{"field": "technique"}, {"field": field}]},
        },
        {
            "transform": [{"filter": "datum.front"}],
            "mark": {"type": "line", "strokeDash": [5, 4], "color": "black"},
            "encoding": {"x": x, "y": y},
        },
        {
            "transform": [has_error],
            "mark": _POINT,
            "encoding": {
                "x": x,
                "y": y,
                "color": _COLOUR,
                "shape": _SHAPE,
                "tooltip": [{"field": name} for name in ("technique", "budget", field, "mse", "score")],
            },
        },
        {
            "transform": [has_error, {"filter": "datum.budget != null"}],
            "mark": {"type": "text", "dx": 8, "dy": -8, "fontSize": 10},
            "encoding": {"x": x, "y": y, "text": {"field": "budget"}},
        },
    ]
    return {
        "$schema": SCHEMA,
        "title": {"text": title, "subtitle": "Numbers: F / WH. Dashed: the Pareto front, without the oracle."},
        "data": {"values": points},
        "facet": {"field": "group", "type": "nominal", "title": None, "sort": None},
        "columns": _COLUMNS,
        "spec": {**_PANEL, "layer": layers},
        "resolve": {"scale": {"x": "independent", "y": "independent"}},
    }


def _points(group: Group, field: str, cost: Callable[[Row], float | None]) -> list[dict[str, Any]]:
    rows = [(row, x) for row in _shown(group) if (x := cost(row))]
    front = set(pareto_front([(x, row.mse) for row, x in rows if row.is_runnable and row.mse is not None]))
    return [{**_about(group, row), field: x, "front": row.is_runnable and (x, row.mse) in front} for row, x in rows]


def _bars(groups: Sequence[Group]) -> dict[str, Any]:
    """DHOIT's Figure 6: squared error of the bounded techniques, a row for each budget."""
    shown = [(group, row) for group in groups for row in _shown(group)]
    values = [_about(group, row) for group, row in shown if row.key.basis == "fragments"]
    mse = {"field": "mse", "type": "quantitative", "scale": {"type": "log"}, "title": "MSE ×1e-5"}
    return {
        "$schema": SCHEMA,
        "title": "Squared error within budgets (DHOIT, Fig. 6)",
        "data": {"values": values},
        "mark": _POINT,
        "encoding": {
            "row": {"field": "budget", "type": "nominal", "title": "F / WH"},
            "x": {"field": "group", "type": "nominal", "sort": None, "title": None},
            "y": mse,
            "color": _COLOUR,
            "shape": _SHAPE,
            "tooltip": [{"field": name} for name in ("group", "technique", "budget", "mse", "score")],
        },
    }


def _shown(group: Group) -> list[Row]:
    rows = [*measured(group.rows, "fragments"), *measured(group.rows, "none")]
    return [row for row in rows if row.mse is not None or row.family == "exact"]


def _about(group: Group, row: Row) -> dict[str, Any]:
    return {
        "group": group.title,
        "technique": said_technique(row.key),
        "name": row.key.technique,
        "tail": said_tail(row.key) or "none",
        "family": row.family,
        "budget": row.key.budget_factor,
        "mse": None if row.mse is None else 1e5 * row.mse,
        "score": row.score,
    }
