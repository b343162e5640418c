"""Where the labels of points go: beside their points, over no other label and no mark, at every width of the chart."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

HEIGHT: Final = 300
"""Height of a plot in pixels."""
_WIDTHS: Final = (250.0, 560.0)
"""Widths of a plot in pixels: of a telephone, and of a page."""
_LETTER, _LINE, _MARK = 6.4, 12.0, 5.5
"""Width and height of a letter, and half of a mark, pixels."""

Align = Literal["left", "right", "center"]
_PLACES: Final[tuple[tuple[Align, float, float], ...]] = (
    ("left", 8, -8),
    ("left", 8, 9),
    ("right", -8, -8),
    ("right", -8, 9),
    ("center", 0, -13),
    ("center", 0, 14),
)
_Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Label:
    """Where a label stands from its point.

    Attributes:
        text: Of the label; '' where there is no room: the point has its values when it is pointed at.
        align: Which part of it.
        dx: To the right, pixels.
        dy: Down, pixels; the label's middle.
    """

    text: str
    align: Align
    dx: float
    dy: float


@dataclass(frozen=True, slots=True)
class Span:
    """The values that an axis shows; positive where it is logarithmic."""

    low: float
    high: float
    is_log: bool = True

    def fraction(self, value: float) -> float:
        """Where on the axis a value is: 0 at its start, 1 at its end."""
        if self.is_log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


def place(points: Sequence[tuple[float, float, str]], x: Span, y: Span) -> list[Label]:
    """The label of each point, at the first place around it that is free in a narrow and in a wide chart.

    Args:
        points: Values of a point, and its text; '' for a mark without one.
        x: What the horizontal axis shows.
        y: What the vertical axis shows.
    """
    where = [[(width * x.fraction(a), HEIGHT * (1 - y.fraction(b))) for a, b, _ in points] for width in _WIDTHS]
    taken = [[(px - _MARK, py - _MARK, px + _MARK, py + _MARK) for px, py in at] for at in where]
    made = []
    for i, (_, _, text) in enumerate(points):
        label = Label("", *_PLACES[0])
        for align, dx, dy in _PLACES if text else ():
            boxes = [_box(at[i], text, align, dx, dy) for at in where]
            if all(map(_is_free, boxes, taken, _WIDTHS)):
                label = Label(text, align, dx, dy)
                for of, box in zip(taken, boxes, strict=True):
                    of.append(box)
                break
        made.append(label)
    return made


def _box(at: tuple[float, float], text: str, align: Align, dx: float, dy: float) -> _Box:
    width = _LETTER * len(text)
    left = at[0] + dx - {"left": 0.0, "right": width, "center": width / 2}[align]
    middle = at[1] + dy
    return left, middle - _LINE / 2, left + width, middle + _LINE / 2


def _is_free(box: _Box, taken: Iterable[_Box], width: float) -> bool:
    left, top, right, bottom = box
    inside = left >= 0 and right <= width and top >= 0 and bottom <= HEIGHT
    return inside and not any(left < x1 and right > x0 and top < y1 and bottom > y0 for x0, y0, x1, y1 in taken)
