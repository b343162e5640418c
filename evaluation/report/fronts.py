"""What an error costs: time or memory of every technique and budget against its error, and the Pareto front."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

from evaluation.looks import INK, PAGE, look, technique_order, title
from evaluation.report.labels import Span, place
from evaluation.report.vega import NUMBER, Spec, axis, chart, log_ticks, marks
from evaluation.summary import EXACT, MSE_FLOOR, ORACLE, Row, e5, number

POINT: Final[Spec] = {"type": "point", "size": 90, "strokeWidth": 1.5, "opacity": 1.0}
"""Mark of a technique."""
PICKED: Final[Spec] = {"name": "picked", "select": {"type": "point", "fields": ["series"]}, "bind": "legend"}
"""Selects the series that are clicked in the legend."""
_ROOM: Final = 3.0
"""Factor between the least error and the place of an error of 0, and from there to the axis."""


class Costly(Protocol):
    """What has a time and a size; `Row`s of all kinds do."""

    @property
    def ms(self) -> float | None:
        """Wall time of a frame."""

    @property
    def total_bytes(self) -> int | None:
        """Memory of all buffers."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What an error is set against.

    Attributes:
        of: The cost of a row; None: not measured.
        axis: Label of the axis, and what a screen reader says.
        unit: Of the values.
    """

    of: Callable[[Costly], float | None]
    axis: str
    unit: str


TIME: Final = Cost(lambda row: row.ms, "time of a frame", "ms")
MEMORY: Final = Cost(lambda row: row.total_bytes and row.total_bytes / 2**20, "memory of all buffers", "MiB")


@dataclass(frozen=True, slots=True)
class Point:
    """A technique at a budget.

    Attributes:
        technique: Its name.
        budget_factor: F / (width * height); None for one that reads no budget.
        cost: What the error is set against; positive.
        mse: Mean squared error of values in [0, 1]; 0 for an exact picture.
        tail: Its tail, where that is not the default.
        is_runnable: Whether a renderer can have it: not the oracle.
        note: More to say, for instance how many views the mean is over.
    """

    technique: str
    budget_factor: float | None
    cost: float
    mse: float
    tail: str = ""
    is_runnable: bool = True
    note: str = ""

    @property
    def series(self) -> str:
        """What the points of a line have in common."""
        return said(self.technique, self.tail)


def said(technique: str, tail: str = "") -> str:
    """Title of a technique with its tail, where that is not the default."""
    return f"{title(technique)}, {tail}" if tail else title(technique)


def points_of(rows: Sequence[Row], cost: Cost) -> list[Point]:
    """Points of rows that have a cost and an error, or are exact: the technique, or its budget holds every fragment."""
    return [
        Point(
            row.technique,
            row.budget_factor if row.technique != EXACT else None,
            value,
            row.mse or 0.0,
            is_runnable=row.technique != ORACLE,
            note=f"mean over {row.averaged} of {row.views} views" if row.mse and row.averaged < row.views else "",
        )
        for row in rows
        if (value := cost.of(row)) and (row.mse is not None or row.is_exact)
    ]


def front_of(points: Sequence[Point]) -> list[Point]:
    """The points of the Pareto front of what a renderer can run, exact techniques included."""
    front = set(pareto_front([(p.cost, p.mse) for p in points if p.is_runnable]))
    return [p for p in points if p.is_runnable and (p.cost, p.mse) in front]


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points that no other beats or equals in both coordinates (less is better), by the first coordinate."""
    front: list[tuple[float, float]] = []
    for x, y in sorted(set(points)):
        if not front or y < front[-1][1]:
            front.append((x, y))
    return front


def error_chart(points: Sequence[Point], label: str, cost: Cost = TIME) -> Spec | None:
    """A cost against mse (x1e-5), a point for every technique and budget; None without a point.

    The dashed line is the Pareto front of what a renderer can run, exact techniques included. An error of 0 has no
    place on a logarithmic axis: it stands below all others, on a line of its own.

    Args:
        points: Of any techniques and budgets, each once.
        label: What they are of.
        cost: What the error is set against.
    """
    if not points:
        return None
    errors = [max(p.mse, MSE_FLOOR) * 1e5 for p in points if p.mse] or [1.0]
    zero = min(errors) / _ROOM if any(not p.mse for p in points) else None
    x = Span(min(p.cost for p in points) / 1.35, max(p.cost for p in points) * 1.35)
    y = Span(min(errors) / 1.8 if zero is None else zero / _ROOM**0.5, max(errors) * 1.8)
    rows = _rows(points, cost, zero, x, y)
    return chart(
        f"{label}: {cost.axis} against mean squared error, by technique and budget",
        _layers(rows, cost, zero, x, y),
        rows,
    )


def _rows(points: Sequence[Point], cost: Cost, zero: float | None, x: Span, y: Span) -> list[dict[str, Any]]:
    front = front_of(points)
    heights = [max(p.mse, MSE_FLOOR) * 1e5 if p.mse else zero or 0.0 for p in points]
    texts = [f"{p.budget_factor:g}" if p.budget_factor else "" for p in points]
    labels = place([(p.cost, at, text) for p, at, text in zip(points, heights, texts, strict=True)], x, y)
    return [
        {
            "series": p.series,
            "technique": p.technique,
            "tail": p.tail,
            "budget": p.budget_factor,
            "cost": p.cost,
            "mse": p.mse * 1e5,
            "y": height,
            "front": p in front,
            "label": at.text,
            "align": at.align,
            "dx": at.dx,
            "dy": at.dy,
            "said": _said(p, cost),
        }
        for p, height, at in zip(points, heights, labels, strict=True)
    ]


def _said(p: Point, cost: Cost) -> str:
    budget = f", F = {p.budget_factor:g} W H" if p.budget_factor else ""
    error = f"MSE {e5(p.mse)}e-5" if p.mse else "exact"
    return f"{p.series}{budget}: {number(p.cost)} {cost.unit}, {error}{f' ({p.note})' if p.note else ''}"


def _layers(rows: Sequence[dict[str, Any]], cost: Cost, zero: float | None, x: Span, y: Span) -> list[Spec]:
    across = axis("cost", f"{cost.axis}, {cost.unit}", x)
    up = axis("y", "MSE ×1e-5", y)
    if zero is not None:
        round_values = [tick for tick in log_ticks(y.low, y.high) if tick > zero * 1.3]
        up["axis"] |= {
            "values": [zero, *round_values],
            "labelExpr": f"datum.value < {zero * 1.1} ? '0' : {NUMBER}",
        }
    both = {"x": across, "y": up}
    looked = looks_of({row["series"]: (row["technique"], row["tail"]) for row in rows})
    faded = {"condition": {"param": "picked", "value": 1.0}, "value": 0.12}
    line = {"type": "line", "strokeWidth": 1.5}
    return [
        {
            "transform": [{"filter": "datum.mse > 0 && datum.budget !== null"}],
            "mark": line,
            "encoding": {
                **both,
                "stroke": looked["stroke"],
                "order": {"field": "budget"},
                "opacity": {"condition": {"param": "picked", "value": 0.5}, "value": 0.08},
            },
        },
        {
            "transform": [{"filter": "datum.front"}],
            "mark": {**line, "color": INK, "strokeWidth": 1.2, "strokeDash": [5, 4], "opacity": 0.7},
            "encoding": both,
        },
        marks(
            POINT,
            {**both, **looked, "opacity": faded},
            params=[PICKED],
        ),
        {
            "transform": [{"filter": "datum.label !== ''"}],
            "mark": {"type": "text", **{name: {"expr": f"datum.{name}"} for name in ("align", "dx", "dy")}},
            "encoding": {**both, "text": {"field": "label"}, "opacity": faded},
        },
    ]


def looks_of(series: Mapping[str, tuple[str, str]]) -> Spec:
    """Fill, outline and mark of each series, as encodings; its lines have the colour of the outline.

    Args:
        series: Name -> technique, and its tail where that is not the default: those are drawn hollow.
    """
    order = technique_order(technique for technique, _ in series.values())
    domain = sorted(series, key=lambda name: (order.index(series[name][0]), series[name][1]))
    colours = [look(series[name][0]).light for name in domain]
    fills = [PAGE if series[name][1] else colour for name, colour in zip(domain, colours, strict=True)]
    shapes = [look(series[name][0]).shape for name in domain]

    def of(values: Sequence[str]) -> Spec:
        opaque = {"symbolOpacity": 1.0}
        return {"field": "series", "type": "nominal", "scale": {"domain": domain, "range": values}, "legend": opaque}

    return {"fill": of(fills), "stroke": of(colours), "shape": of(shapes)}
