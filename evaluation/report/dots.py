"""Errors of techniques side by side, scene by scene, on a logarithmic axis (DHOIT's Figure 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from evaluation.report.fronts import PICKED, POINT, looks_of, said
from evaluation.report.labels import Span
from evaluation.report.vega import NUMBER, Spec, axis, chart, log_ticks, marks
from evaluation.summary import MSE_FLOOR, e5

_ROW: Final = 44
"""Height of a scene, pixels."""
_ABOVE: Final[Spec] = {
    "labelAlign": "left",
    "labelPadding": -6,
    "labelOffset": 5 - _ROW // 2,
    "labelLimit": 340,
    "labelFontSize": 11,
    "grid": True,
    "zindex": 1,
}
"""What a row is of stands over its marks: beside them it would leave no room on a telephone."""
_ROOM: Final = 2.5
"""Factor between the least error and the place of an error of 0."""


@dataclass(frozen=True, slots=True)
class Dot:
    """The error of a technique on a scene.

    Attributes:
        row: What it was measured on.
        technique: Its name; a series that is no technique, in words.
        mse: Mean squared error of values in [0, 1]; 0 for an exact picture.
        tail: Its tail, where that is not the default.
    """

    row: str
    technique: str
    mse: float
    tail: str = ""


def error_dots(dots: Sequence[Dot], description: str) -> Spec | None:
    """A row for each scene, a mark for each technique on it; None without an error above 0.

    What is exact stands left of all others, where the axis says 0.

    Args:
        dots: In the order of their rows, each technique and tail once in a row.
        description: What a screen reader says.
    """
    errors = [max(dot.mse, MSE_FLOOR) * 1e5 for dot in dots if dot.mse]
    if not errors:
        return None
    zero = min(errors) / _ROOM
    has_exact = any(not dot.mse for dot in dots)
    x = axis("x", "MSE ×1e-5", Span(zero / 1.5 if has_exact else min(errors) / 1.5, max(errors) * 1.5))
    if has_exact:
        ticks = [tick for tick in log_ticks(*x["scale"]["domain"]) if tick > zero * 1.3]
        is_zero = f"datum.value < {zero * 1.1} ? '0' : {NUMBER}"
        x["axis"] |= {"values": [zero, *ticks], "labelExpr": is_zero}
    rows = [
        {
            "row": dot.row,
            "series": said(dot.technique, dot.tail),
            "tail": dot.tail,
            "mse": dot.mse * 1e5,
            "x": max(dot.mse, MSE_FLOOR) * 1e5 if dot.mse else zero,
            "said": f"{dot.row}, {said(dot.technique, dot.tail)}: " + (f"MSE {e5(dot.mse)}e-5" if dot.mse else "exact"),
        }
        for dot in dots
    ]
    names = list(dict.fromkeys(dot.row for dot in dots))
    y = {"field": "row", "type": "nominal", "sort": names, "title": None}
    looked = looks_of({said(dot.technique, dot.tail): (dot.technique, dot.tail) for dot in dots})
    encoding = {
        "x": x,
        "y": {**y, "axis": _ABOVE},
        **looked,
        "opacity": {"condition": {"param": "picked", "value": 1.0}, "value": 0.12},
    }
    return chart(description, [marks(POINT, encoding, params=[PICKED])], rows, height=_ROW * len(names))
