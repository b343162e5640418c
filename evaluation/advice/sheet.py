"""The contact sheet: where the advised picture is worst, beside the exact one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from evaluation.report import colours
from evaluation.report.pictures import data_uri, squared_error, worst_spot
from evaluation.summary import number
from renderer import metrics
from schemas.advice import Candidate
from schemas.colour import display8

if TYPE_CHECKING:
    from evaluation.advice.measure import Measuring

SPOT: Final = (32, 48)
"""Rows and columns of a spot."""
_ZOOM: Final = 10
_ERRORS: Final = (1e-5, 1e-1)
"""Squared errors at the ends of the colour map, logarithmic."""


@dataclass(frozen=True, slots=True)
class Tile:
    """A picture of the sheet: its data URI, its caption, and what a reader who cannot see it is told."""

    uri: str
    caption: str
    alternative: str


@dataclass(frozen=True, slots=True)
class Line:
    """A view of the sheet.

    Attributes:
        title: The view and its error.
        tiles: Exact, advised, their difference, and both magnified around the worst spot.
    """

    title: str
    tiles: tuple[Tile, ...]


@dataclass(frozen=True, slots=True)
class Sheet:
    """All views, the worst first.

    Attributes:
        technique: Whose errors are shown.
        lines: The views.
    """

    technique: str
    lines: tuple[Line, ...]


def sheet(measuring: Measuring, one: Candidate) -> Sheet:
    """The sheet of a candidate.

    Args:
        measuring: The scene and its views.
        one: Whose errors are shown.
    """
    found = []
    for view in measuring.views:
        subject = measuring.subject(view)
        if subject.dump.total:
            image = display8(measuring.rendered(subject, one).linear)
            found.append((metrics.mse(image, subject.exact8), view.name, image, subject.exact8))
    found.sort(key=lambda each: (-each[0], each[1]))
    lines = [_line(name, one.technique, error, image, exact) for error, name, image, exact in found]
    return Sheet(one.technique, tuple(lines))


def _line(name: str, technique: str, mse: float, image: NDArray[np.uint8], exact: NDArray[np.uint8]) -> Line:
    error = squared_error(image, exact)
    spot = worst_spot(error, SPOT)
    low, high = _ERRORS
    heat = colours.apply(np.log(np.maximum(error, low) / low) / np.log(high / low), colours.HEAT)
    share = float(error[spot].sum() / error.sum()) if error.any() else 0.0
    where = f"columns {spot[1].start} to {spot[1].stop - 1}, rows {spot[0].start} to {spot[0].stop - 1}"
    told = f"{where}: {share:.0%} of the error"
    tiles = (
        Tile(data_uri(exact, 88), "exact", f"{name}: exact"),
        Tile(data_uri(image, 88), technique, f"{name}: {technique}"),
        Tile(data_uri(heat, 75), f"squared error, log scale, {low:g} to {high:g}", f"{name}: squared error"),
        Tile(data_uri(_magnified(exact[spot]), 88), "exact, worst spot", f"{name}: exact, {where}"),
        Tile(data_uri(_magnified(image[spot]), 88), f"{technique}, {told}", f"{name}: {technique}, {where}"),
    )
    return Line(f"{name}: MSE {number(1e5 * mse)}e-5", tiles)


def _magnified(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(np.repeat(np.repeat(image, _ZOOM, axis=0), _ZOOM, axis=1))
