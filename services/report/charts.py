"""Charts as inline SVG. Colours are CSS variables, so that the page's light and dark themes reach into them."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from schemas.measurement import TrainingPoint
from services.summary import EXACT, ORACLE, Row, number, technique_order, title

Corners = Sequence[tuple[float, float]]

_STAR_RADII = (1.0, 0.45)
MARKS: dict[str, tuple[float, Corners]] = {
    "kbuffer": (4.5, [(-1, -1), (1, -1), (1, 1), (-1, 1)]),
    "kbuffer-dynamic": (6.0, [(0, -1), (1, 0), (0, 1), (-1, 0)]),
    "kbuffer-importance": (6.5, [(0, -1), (0.9, 0.7), (-0.9, 0.7)]),
    "kbuffer-optimal": (
        7.5,
        [
            (_STAR_RADII[i % 2] * math.sin(i * math.pi / 5), -_STAR_RADII[i % 2] * math.cos(i * math.pi / 5))
            for i in range(10)
        ],
    ),
}
"""Radius (SVG units) and corners (units of it) of each technique's mark; techniques without an entry get a disc."""


@dataclass(frozen=True, slots=True)
class Frame:
    """The plotting area in SVG units and the value ranges of its axes (positive; shown on log axes if `log_*`)."""

    x: tuple[float, float]
    y: tuple[float, float]
    log_x: bool = True
    log_y: bool = True
    width: float = 520.0
    height: float = 340.0
    left: float = 64.0
    right: float = 18.0
    top: float = 14.0
    bottom: float = 48.0

    def px(self, value: float) -> float:
        """Horizontal position of a value."""
        return self.left + _fraction(value, self.x, self.log_x) * (self.width - self.left - self.right)

    def py(self, value: float) -> float:
        """Vertical position of a value; up is more."""
        return self.height - self.bottom - _fraction(value, self.y, self.log_y) * (self.height - self.top - self.bottom)


def log_ticks(low: float, high: float) -> list[float]:
    """Powers of ten within the range, with round values between them where there is room; at most eight ticks."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 1.5, 2, 3, 4, 5, 6, 8), (1, 2, 3, 5), (1, 2, 5), (1, 3), (1,)):
        ticks = [s * 10.0**d for d in decades for s in steps if low <= s * 10.0**d * (1 + 1e-9) <= high * (1 + 2e-9)]
        if len(ticks) <= 8:
            return ticks
    stride = math.ceil(len(ticks) / 8)
    return ticks[::stride]


def linear_ticks(low: float, high: float) -> list[float]:
    """About five round values within the range."""
    step = 10.0 ** math.floor(math.log10((high - low) / 5.0))
    step *= next(s for s in (1.0, 2.0, 5.0, 10.0) if (high - low) / (step * s) <= 6.0)
    return [i * step for i in range(math.ceil(low / step), math.floor(high / step) + 1)]


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points that no other beats or equals in both coordinates (less is better), by the first coordinate."""
    front: list[tuple[float, float]] = []
    for x, y in sorted(set(points)):
        if not front or y < front[-1][1]:
            front.append((x, y))
    return front


@dataclass(frozen=True, slots=True)
class Cost:
    """What an error is set against.

    Attributes:
        of: The cost of a row; None: not measured.
        axis: Label of the axis, and what a screen reader says.
        unit: Of the values.
    """

    of: Callable[[Row], float | None]
    axis: str
    unit: str


TIME = Cost(lambda row: row.ms, "wall time of a frame", "ms")
MEMORY = Cost(lambda row: row.total_bytes and row.total_bytes / 2**20, "memory of all buffers", "MiB")


def error_chart(rows: Sequence[Row], label: str, cost: Cost = TIME) -> str:
    """A cost against mse (x1e-5) on log axes, a point for every technique and budget.

    The dashed line is the Pareto front of the techniques that a renderer can run, so without the oracle.

    The exact picture, whose error no logarithmic axis can show, is a vertical line at its cost.

    Rows without cost or error are left out; '' if none is left.
    """
    points = {(r.technique, r.budget_factor): (x, r.mse * 1e5) for r in rows if (x := cost.of(r)) and r.mse}
    if not points:
        return ""
    xs, ys = [x for x, _ in points.values()], [y for _, y in points.values()]
    exact = [x for r in rows if r.technique == EXACT and (x := cost.of(r))]
    frame = Frame(_padded_log([*xs, *exact], 1.35), _padded_log(ys, 1.8))
    real = [point for (technique, _), point in points.items() if technique.partition(" ")[0] != ORACLE]
    parts = [_axes(frame, f"{cost.axis}, {cost.unit}", "MSE ×1e-5"), _front(frame, pareto_front(real))]
    parts += [_exact_line(frame, x, cost) for x in exact]
    labels = _Labels(frame)
    for technique in technique_order(name for name, _ in points):
        own = sorted((budget, *points[name, budget]) for name, budget in points if name == technique)
        parts.append(_series(frame, technique, own, cost, labels))
    return _svg(frame, parts, f"{label}: {cost.axis} against mean squared error, by technique and budget")


def loss_chart(points: Sequence[tuple[int, float]]) -> str:
    """Loss of batches by step; '' with fewer than two points."""
    return _by_step([(float(step), loss) for step, loss in points], "loss", "Loss of a batch, by training step")


def training_chart(history: Sequence[TrainingPoint]) -> str:
    """Error over the optimum on the training views, by step; '' with fewer than two points."""
    points = [(float(p.step), p.over_optimum) for p in history]
    return _by_step(points, "error / optimum", "Squared error over the optimum's, by training step")


def _by_step(points: Sequence[tuple[float, float]], what: str, description: str) -> str:
    if len(points) < 2:
        return ""
    values = [y for _, y in points]
    steps = (points[0][0], max(points[-1][0], points[0][0] + 1.0))
    span = (max(values) - min(values)) or max(abs(values[0]), 1.0)
    heights = (min(values) - 0.05 * span, max(values) + 0.05 * span)
    frame = Frame(steps, heights, log_x=False, log_y=False, width=640.0, height=280.0)
    return _svg(frame, [_axes(frame, "step", what), _line(frame, points, "line training")], description)


def history_chart(
    series: Mapping[str, Sequence[float | None]], labels: Sequence[str], worse: Collection[tuple[str, int]], what: str
) -> str:
    """Errors (mse x1e-5, log axis) by version, a line for each series; '' with fewer than two versions with values.

    Args:
        series: Name -> mse of each version; None where there is none.
        labels: Of the versions, in order.
        worse: Name and index of the values that are to stand out.
        what: What a screen reader says.
    """
    points = {
        name: [(float(i), v * 1e5) for i, v in enumerate(values) if v is not None] for name, values in series.items()
    }
    heights = [y for line in points.values() for _, y in line]
    if len({x for line in points.values() for x, _ in line}) < 2:
        return ""
    frame = Frame((-0.5, len(labels) - 0.5), _padded_log(heights, 1.8), log_x=False, width=640.0)
    step = max(1, math.ceil(len(labels) / 10))
    ticks = [(float(i), label) for i, label in enumerate(labels) if i % step == 0]
    parts = [_axes(frame, "version", "MSE ×1e-5", ticks)]
    for name, line in points.items():
        parts.append(_line(frame, line, "link"))
        for x, y in line:
            is_worse = (name, int(x)) in worse
            mark = _mark("kbuffer-importance" if is_worse else "kbuffer", frame.px(x), frame.py(y))
            told = f"{name}, {labels[int(x)]}: {number(y)}e-5{', worse than before' if is_worse else ''}"
            css = "mark worse" if is_worse else "mark"
            parts.append(f'<g class="{css}">{mark}<title>{escape(told)}</title></g>')
    return _svg(frame, parts, what)


def curve_chart(curve: Sequence[float], hull: Sequence[int], chosen: Mapping[int, Sequence[str]], what: str) -> str:
    """The error curve of a pixel (squared error x1e-5, linear axes), its lower hull, and the k that were chosen.

    Args:
        curve: `e_p(k)` for k = 0..n.
        hull: Vertices k of the hull; none if there is nothing to gain.
        chosen: k -> who chose it.
        what: What a screen reader says.

    Returns:
        SVG; '' if the pixel is exact for every k.
    """
    points = [(float(k), 1e5 * error) for k, error in enumerate(curve)]
    top = max(y for _, y in points)
    if top == 0.0:
        return ""
    n = len(points) - 1
    frame = Frame((0.0, float(n)), (0.0, 1.05 * top), log_x=False, log_y=False, height=260.0)
    ticks = [(k, f"{k:g}") for k in linear_ticks(0.0, float(n)) if k == int(k)]
    parts = [_axes(frame, "core fragments k", "squared error ×1e-5", ticks)]
    parts += [_line(frame, points, "line curve"), _line(frame, [points[k] for k in hull], "front")]
    for k, who in sorted(chosen.items()):
        x, y = frame.px(float(k)), frame.py(points[k][1])
        told = f"k = {k}, {number(points[k][1])}e-5: {', '.join(who)}"
        rule = f'<path class="exact" d="M{x:.1f} {frame.top}V{frame.height - frame.bottom}"/>'
        dot = f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5"/>'
        parts.append(f'<g class="mark">{rule}{dot}<title>{escape(told)}</title></g>')
        letters = " ".join(name for name in who if len(name) == 1)
        parts.append(_text("point", "start", x + 4, frame.top + 10, letters) if letters else "")
    return _svg(frame, parts, what)


def legend(techniques: Sequence[str]) -> str:
    """Marks and titles of techniques in a row, and what the dashed line and the numbers mean."""
    items = [_key(f"t-{t} mark", 18, _mark(t, 9, 9), title(t)) for t in technique_order(techniques)]
    items.append(_key("wide", 26, '<path class="front" d="M1 9H25"/>', "Pareto front, without the oracle"))
    items.append('<span class="key">numbers: F / (W H)</span>')
    return f'<p class="legend">{"".join(items)}</p>'


def _key(css: str, width: int, drawing: str, text: str) -> str:
    svg = f'<svg class="{escape(css)}" viewBox="0 0 {width} 18" aria-hidden="true">{drawing}</svg>'
    return f'<span class="key">{svg}{escape(text)}</span>'


class _Labels:
    """Places the labels of points: the first of four places around the point where no label is yet."""

    _LETTER, _LINE = 6.2, 11.0

    def __init__(self, frame: Frame) -> None:
        self._right = frame.width
        self._taken: list[tuple[float, float, float, float]] = []

    def place(self, x: float, y: float, text: str) -> str:
        """SVG of a label; where all four places are taken, above and to the right."""
        width = self._LETTER * len(text)
        places = [(x + 8, y - 6), (x + 8, y + 14), (x - 8 - width, y - 6), (x - 8 - width, y + 14)]
        left, base = next((place for place in places if self._is_free(*place, width)), places[0])
        self._taken.append((left, base - self._LINE, left + width, base))
        end = left < x
        return _text("point", "end" if end else "start", left + width if end else left, base, text)

    def _is_free(self, left: float, base: float, width: float) -> bool:
        right, top = left + width, base - self._LINE
        return right <= self._right and not any(
            left < x1 and right > x0 and top < y1 and base > y0 for x0, y0, x1, y1 in self._taken
        )


def _series(
    frame: Frame, technique: str, points: Sequence[tuple[float, float, float]], cost: Cost, labels: _Labels
) -> str:
    path = " ".join(f"{frame.px(x):.1f},{frame.py(y):.1f}" for _, x, y in points)
    marks = "".join(
        f'<g class="mark">{_mark(technique, frame.px(x), frame.py(y))}'
        f"<title>{escape(title(technique))}{f', F = {budget:g} W H' if budget else ''}: "
        f"{number(x)} {cost.unit}, {number(y)}e-5</title></g>"
        f"{labels.place(frame.px(x), frame.py(y), f'{budget:g}' if budget else title(technique))}"
        for budget, x, y in points
    )
    return f'<g class="t-{escape(technique)}"><polyline class="link" points="{path}"/>{marks}</g>'


def _exact_line(frame: Frame, value: float, cost: Cost) -> str:
    x = frame.px(value)
    line = f'<path class="exact" d="M{x:.1f} {frame.top}V{frame.height - frame.bottom}"/>'
    return f'<g class="mark">{line}<title>exact: {number(value)} {cost.unit}</title></g>' + _text(
        "point", "start", x + 4, frame.top + 10, "exact"
    )


def _front(frame: Frame, front: Sequence[tuple[float, float]]) -> str:
    return _line(frame, front, "front") if len(front) > 1 else ""


def _line(frame: Frame, points: Sequence[tuple[float, float]], css: str) -> str:
    path = " ".join(f"{frame.px(x):.1f},{frame.py(y):.1f}" for x, y in points)
    return f'<polyline class="{css}" points="{path}"/>'


def _axes(frame: Frame, x_label: str, y_label: str, x_ticks: Sequence[tuple[float, str]] | None = None) -> str:
    left, right = frame.left, frame.width - frame.right
    top, bottom = frame.top, frame.height - frame.bottom
    parts = []
    if x_ticks is None:
        x_ticks = [(v, _tick(v)) for v in (log_ticks(*frame.x) if frame.log_x else linear_ticks(*frame.x))]
    for value, text in x_ticks:
        x = frame.px(value)
        parts.append(f'<path class="grid" d="M{x:.1f} {top}V{bottom}"/>')
        parts.append(_text("tick", "middle", x, bottom + 17, text))
    for value in log_ticks(*frame.y) if frame.log_y else linear_ticks(*frame.y):
        y = frame.py(value)
        parts.append(f'<path class="grid" d="M{left} {y:.1f}H{right}"/>')
        parts.append(_text("tick", "end", left - 7, y + 4, _tick(value)))
    parts.append(f'<path class="axis" d="M{left} {top}V{bottom}H{right}"/>')
    parts.append(_text("label", "middle", (left + right) / 2, frame.height - 10, x_label))
    turned = _text("label", "middle", 0, 0, y_label)
    parts.append(f'<g transform="translate(15 {(top + bottom) / 2}) rotate(-90)">{turned}</g>')
    return "".join(parts)


def _text(css: str, anchor: str, x: float, y: float, text: str) -> str:
    return f'<text class="{css}" text-anchor="{anchor}" x="{x:.1f}" y="{y:.1f}">{escape(text)}</text>'


def _svg(frame: Frame, parts: Sequence[str], description: str) -> str:
    size = f"{frame.width:g} {frame.height:g}"
    return (
        f'<svg class="chart" viewBox="0 0 {size}" role="img" aria-label="{escape(description)}">{"".join(parts)}</svg>'
    )


def _mark(technique: str, x: float, y: float) -> str:
    if technique not in MARKS:
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5.5"/>'
    radius, corners = MARKS[technique]
    points = " ".join(f"{x + radius * dx:.1f},{y + radius * dy:.1f}" for dx, dy in corners)
    return f'<polygon points="{points}"/>'


def _fraction(value: float, span: tuple[float, float], log: bool) -> float:
    low, high = span
    return math.log(value / low) / math.log(high / low) if log else (value - low) / (high - low)


def _padded_log(values: Sequence[float], factor: float) -> tuple[float, float]:
    return min(values) / factor, max(values) * factor


def _tick(value: float) -> str:
    return f"{value:g}" if value == 0 or 1e-4 < abs(value) < 1e6 else f"{value:.0e}"
