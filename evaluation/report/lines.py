"""Lines: a training by step, errors by version, the curve of a pixel, and anything on logarithmic axes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

from evaluation.looks import INK, LOOKS, SOFT
from evaluation.report.labels import Span, place
from evaluation.report.vega import Spec, axis, chart, marks
from evaluation.summary import number
from schemas.measurement import TrainingPoint

_BLUE: Final = LOOKS["kbuffer-deep"].light
_WORSE: Final = LOOKS["kbuffer-importance"].light
COLOURS: Final = tuple(
    LOOKS[name].light for name in ("kbuffer-deep", "kbuffer-dynamic", "kbuffer-optimal", "moment", "kbuffer")
)
"""Of series that are no techniques."""
_SHAPES: Final = ("circle", "square", "triangle-up", "diamond", "cross", "triangle-down", "triangle-left")
Points = Sequence[tuple[float, float]]


def loss_chart(points: Sequence[tuple[int, float]]) -> Spec | None:
    """Loss of batches by step; None with fewer than two points."""
    return _by_step([(float(step), loss) for step, loss in points], "loss", "Loss of a batch, by training step")


def training_chart(history: Sequence[TrainingPoint]) -> Spec | None:
    """Error over the optimum on the training views, by step; None with fewer than two points."""
    points = [(float(p.step), p.over_optimum) for p in history]
    return _by_step(points, "error / optimum", "Squared error over the optimum's, by training step")


def _by_step(points: Points, what: str, description: str) -> Spec | None:
    if len(points) < 2:
        return None
    x = Span(points[0][0], max(points[-1][0], points[0][0] + 1.0), is_log=False)
    both = {"x": axis("x", "step", x), "y": axis("y", what, _padded([y for _, y in points]))}
    rows = [{"x": x, "y": y, "said": f"step {x:g}: {what} {number(y)}"} for x, y in points]
    layers = [
        {"mark": {"type": "line", "color": _BLUE, "strokeWidth": 1.5}, "encoding": both},
        marks({"type": "point", "filled": True, "color": _BLUE, "size": 14}, both),
    ]
    return chart(description, layers, rows)


def history_chart(
    series: Mapping[str, Sequence[float | None]], labels: Sequence[str], worse: Collection[tuple[str, int]], what: str
) -> Spec | None:
    """Errors (mse x1e-5, log axis) by version, a line for each series; None with fewer than two versions with values.

    Args:
        series: Name -> mse of each version; None where there is none.
        labels: Of the versions, in order.
        worse: Name and index of the values that are to stand out.
        what: What a screen reader says.
    """
    rows: list[dict[str, Any]] = [
        {
            "series": name,
            "version": labels[i],
            "place": i,
            "mse": value * 1e5,
            "worse": (name, i) in worse,
            "said": f"{name}, {labels[i]}: {number(value * 1e5)}e-5"
            + (", worse than before" if (name, i) in worse else ""),
        }
        for name, values in series.items()
        for i, value in enumerate(values)
        if value is not None
    ]
    if len({row["place"] for row in rows}) < 2:
        return None
    heights = [float(row["mse"]) for row in rows]
    y = axis("mse", "MSE ×1e-5", Span(min(heights) / 1.8, max(heights) * 1.8))
    across = {"field": "version", "type": "ordinal", "sort": list(labels), "title": "version"}
    both = {"x": {**across, "axis": {"labelAngle": 0, "labelOverlap": True}}, "y": y}
    stands_out = {"test": "datum.worse"}
    shape = {"condition": {**stands_out, "value": "triangle-up"}, "value": "square"}
    colour = {"condition": {**stands_out, "value": _WORSE}, "value": SOFT}
    line = {"type": "line", "color": SOFT, "opacity": 0.6, "strokeWidth": 1.5}
    layers = [
        {"mark": line, "encoding": {**both, "detail": {"field": "series"}, "order": {"field": "place"}}},
        marks({"type": "point", "filled": True, "size": 70, "opacity": 1.0}, {**both, "shape": shape, "color": colour}),
    ]
    return chart(what, layers, rows)


def curve_chart(
    curve: Sequence[float], hull: Sequence[int], chosen: Mapping[int, Sequence[str]], what: str
) -> Spec | None:
    """The error curve of a pixel (squared error x1e-5, linear axes), its lower hull, and the k that were chosen.

    Args:
        curve: `e_p(k)` for k = 0..n.
        hull: Vertices k of the hull; none if there is nothing to gain.
        chosen: k -> who chose it.
        what: What a screen reader says.

    Returns:
        None if the pixel is exact for every k.
    """
    top = 1e5 * max(curve)
    if top == 0.0:
        return None
    x, y = Span(0.0, len(curve) - 1.0, is_log=False), Span(0.0, 1.08 * top, is_log=False)
    texts = [" ".join(who for who in chosen.get(k, ()) if len(who) == 1) for k in range(len(curve))]
    errors = [1e5 * error for error in curve]
    labels = place([(float(k), errors[k], text) for k, text in enumerate(texts)], x, y)
    rows = [
        {
            "k": k,
            "error": errors[k],
            "hull": k in hull,
            "chosen": k in chosen,
            "label": labels[k].text,
            "align": labels[k].align,
            "dx": labels[k].dx,
            "dy": labels[k].dy,
            "said": f"k = {k}, {number(errors[k])}e-5" + (f": {', '.join(chosen[k])}" if k in chosen else ""),
        }
        for k in range(len(curve))
    ]
    across = axis("k", "core fragments k", x)
    across["axis"]["values"] = [tick for tick in across["axis"]["values"] if tick == int(tick)]
    both = {"x": across, "y": axis("error", "squared error ×1e-5", y)}
    is_chosen: Spec = {"transform": [{"filter": "datum.chosen"}]}
    text = {"type": "text", **{name: {"expr": f"datum.{name}"} for name in ("align", "dx", "dy")}}
    layers: list[Spec] = [
        {"mark": {"type": "line", "color": _BLUE, "strokeWidth": 2}, "encoding": both},
        {
            "transform": [{"filter": "datum.hull"}],
            "mark": {"type": "line", "color": INK, "strokeDash": [5, 4], "strokeWidth": 1.2, "opacity": 0.7},
            "encoding": both,
        },
        {**is_chosen, "mark": {"type": "rule", "color": INK, "opacity": 0.4}, "encoding": {"x": across}},
        marks({"type": "point", "filled": True, "color": INK, "size": 70, "opacity": 1.0}, both, **is_chosen),
        {**is_chosen, "mark": text, "encoding": {**both, "text": {"field": "label"}}},
    ]
    return chart(what, layers, rows)


def log_log(
    what: str,
    axes: tuple[str, str],
    series: Mapping[str, Points],
    proportional: bool = True,
    apart: Collection[str] = (),
) -> Spec:
    """Series on logarithmic axes.

    Args:
        what: What a screen reader says.
        axes: Words at the horizontal and the vertical axis.
        series: Name -> points, all coordinates positive.
        proportional: Draw a dashed line of slope 1 through the last point of the first series.
        apart: Series whose points no line joins.
    """
    rows: list[dict[str, Any]] = [
        {"series": name, "x": x, "y": y, "joined": name not in apart, "said": f"{name}, {x:.4g}: {y:.4g}"}
        for name, points in series.items()
        for x, y in sorted(points)
    ]
    across, up = (_spread([float(row[of]) for row in rows]) for of in ("x", "y"))
    both = {"x": axis("x", axes[0], across), "y": axis("y", axes[1], up)}
    names = list(series)
    domain: dict[str, Any] = {"field": "series", "type": "nominal"}
    colour = {**domain, "scale": {"domain": names, "range": [COLOURS[i % len(COLOURS)] for i in range(len(names))]}}
    shape = {**domain, "scale": {"domain": names, "range": [_SHAPES[i % len(_SHAPES)] for i in range(len(names))]}}
    layers: list[Spec] = [
        {
            "transform": [{"filter": "datum.joined"}],
            "mark": {"type": "line", "strokeWidth": 1.5},
            "encoding": {**both, "color": colour},
        },
        marks({"type": "point", "filled": True, "size": 45, "opacity": 1.0}, {**both, "color": colour, "shape": shape}),
    ]
    if proportional:
        ends = _slope(next(iter(series.values()))[-1], across, up)
        dashed = {"type": "line", "color": SOFT, "strokeDash": [4, 4], "strokeWidth": 1}
        layers.insert(0, {"data": {"values": ends}, "mark": dashed, "encoding": both})
    return chart(what, layers, rows)


def _slope(through: tuple[float, float], x: Span, y: Span) -> list[dict[str, float]]:
    """Ends of the line where y is proportional to x, within the axes."""
    ratio = through[1] / through[0]
    first, last = max(x.low, y.low / ratio), min(x.high, y.high / ratio)
    return [{"x": at, "y": at * ratio} for at in (first, last)]


def _spread(values: Sequence[float]) -> Span:
    return Span(min(values) / 1.6, max(values) * 1.6)


def _padded(values: Sequence[float]) -> Span:
    room = 0.05 * ((max(values) - min(values)) or max(abs(values[0]), 1.0))
    return Span(min(values) - room, max(values) + room, is_log=False)
