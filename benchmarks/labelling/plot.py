"""Log-log plots as SVG files that show on a white and on a dark page alike."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from html import escape

from services.report.charts import Frame, log_ticks

COLOURS = ("#2f6fb3", "#c25a1c", "#3c8d4d", "#8a4fa8", "#7a7a7a")
_STYLE = (
    "text{font:11px system-ui,sans-serif;fill:#808080}.grid{stroke:#808080;stroke-opacity:.25}"
    ".axis{stroke:#808080;fill:none}.slope{stroke:#808080;stroke-dasharray:4 4}"
)
_MARGIN = 1.6
"""Factor on either side of the values."""
Points = Sequence[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Labels:
    """Words of a plot.

    Attributes:
        title: What a screen reader says.
        x: Of the horizontal axis.
        y: Of the vertical axis.
    """

    title: str
    x: str
    y: str


def log_log(
    labels: Labels, series: Mapping[str, Points], proportional: bool = True, apart: Collection[str] = ()
) -> str:
    """An SVG document.

    Args:
        labels: Words.
        series: Name -> points, all coordinates positive.
        proportional: Draw a dashed line of slope 1 through the last point of the first series.
        apart: Series whose points no line joins.
    """
    xs, ys = zip(*(point for points in series.values() for point in points), strict=True)
    frame = Frame(_range(xs), _range(ys), width=640.0, height=400.0, right=150.0, left=72.0)
    parts = [_axes(frame, labels)]
    if proportional:
        parts.append(_slope(frame, next(iter(series.values()))[-1]))
    for number, (name, points) in enumerate(series.items()):
        parts.append(_series(frame, number, name, sorted(points), name not in apart))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {frame.width:g} {frame.height:g}" role="img" '
        f'aria-label="{escape(labels.title)}"><style>{_STYLE}</style>{"".join(parts)}</svg>\n'
    )


def _range(values: Sequence[float]) -> tuple[float, float]:
    return min(values) / _MARGIN, max(values) * _MARGIN


def _axes(frame: Frame, labels: Labels) -> str:
    left, right, top, bottom = frame.left, frame.width - frame.right, frame.top, frame.height - frame.bottom
    parts = []
    for value in log_ticks(*frame.x):
        x = frame.px(value)
        parts.append(f'<path class="grid" d="M{x:.1f} {top}V{bottom}"/>' + _text(x, bottom + 17, _tick(value)))
    for value in log_ticks(*frame.y):
        y = frame.py(value)
        parts.append(f'<path class="grid" d="M{left} {y:.1f}H{right}"/>' + _text(left - 7, y + 4, _tick(value), "end"))
    parts.append(f'<path class="axis" d="M{left} {top}V{bottom}H{right}"/>')
    parts.append(_text(0.5 * (left + right), frame.height - 10, labels.x))
    turned = f'<g transform="translate(15 {0.5 * (top + bottom):.1f}) rotate(-90)">{_text(0, 0, labels.y)}</g>'
    return "".join([*parts, turned])


def _slope(frame: Frame, through: tuple[float, float]) -> str:
    """Where y is proportional to x, within the frame."""
    ratio = through[1] / through[0]
    first, last = max(frame.x[0], frame.y[0] / ratio), min(frame.x[1], frame.y[1] / ratio)
    ends = [f"{frame.px(x):.1f} {frame.py(x * ratio):.1f}" for x in (first, last)]
    return f'<path class="slope" d="M{ends[0]}L{ends[1]}"><title>proportional</title></path>'


def _series(frame: Frame, number: int, name: str, points: Points, is_joined: bool) -> str:
    colour = COLOURS[number % len(COLOURS)]
    places = [(frame.px(x), frame.py(y)) for x, y in points]
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    marks = "".join(
        f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3.5" fill="{colour}"><title>{x:.4g}: {y:.4g}</title></circle>'
        for (px, py), (x, y) in zip(places, points, strict=True)
    )
    key_x, key_y = frame.width - frame.right + 14, frame.top + 10 + 18 * number
    key = f'<circle cx="{key_x}" cy="{key_y - 4}" r="3.5" fill="{colour}"/>' + _text(key_x + 9, key_y, name, "start")
    line = f'<polyline fill="none" stroke="{colour}" stroke-width="1.5" points="{path}"/>' if is_joined else ""
    return f"{line}{marks}{key}"


def _text(x: float, y: float, text: str, anchor: str = "middle") -> str:
    return f'<text text-anchor="{anchor}" x="{x:.1f}" y="{y:.1f}">{escape(text)}</text>'


def _tick(value: float) -> str:
    return f"{value:g}" if 1e-3 <= value < 1e5 else f"{value:.0e}".replace("e+0", "e").replace("e-0", "e-")
