"""Pictures of the report: what one technique shows of a view, its errors and its core counts as heat maps."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evaluation.looks import technique_order, title
from evaluation.report import colours

ERROR_RANGE = (1e-6, 1e-1)
"""The error heat map is logarithmic between these mean squared errors: about a quarter of an 8-bit step, to obvious."""


@dataclass(frozen=True, slots=True)
class Picture:
    """One technique on one view.

    Attributes:
        image: uint8 [H, W, 3], display sRGB, row 0 at the top.
        flip: float32 [H, W], FLIP error in [0,1].
        k: Integers [H, W], core fragments of each pixel; None for techniques without such.
    """

    image: NDArray[np.uint8]
    flip: NDArray[np.float32]
    k: NDArray[np.integer] | None = None


@dataclass(frozen=True, slots=True)
class PictureSet:
    """All techniques on one view at one budget, side by side.

    Attributes:
        scene: Label of the scene.
        view: Name of the view.
        budget_factor: F / (width * height).
        exact: uint8 [H, W, 3], the exact picture, display sRGB.
        techniques: Pictures by the technique's name.
    """

    scene: str
    view: str
    budget_factor: float
    exact: NDArray[np.uint8]
    techniques: Mapping[str, Picture]


@dataclass(frozen=True, slots=True)
class Cell:
    """A picture in the page: its data URI, what is under it, and what a reader who cannot see it is told."""

    uri: str
    caption: str
    alternative: str


@dataclass(frozen=True, slots=True)
class Strip:
    """A row of pictures of the same kind; `bar` is the CSS gradient of its colour bar, with labels at its ends."""

    title: str
    cells: list[Cell | None]
    bar: str = ""
    low: str = ""
    high: str = ""


@dataclass(frozen=True, slots=True)
class Plate:
    """A view at a budget as the page shows it: one column for the exact picture and one for each technique."""

    scene: str
    view: str
    budget_factor: float
    columns: list[str]
    strips: list[Strip]


def plates(sets: Iterable[PictureSet]) -> list[Plate]:
    """Encodes sets one after the other, so that only one needs to be in memory."""
    return [_plate(pictures) for pictures in sets]


def squared_error(image: NDArray[np.uint8], exact: NDArray[np.uint8]) -> NDArray[np.float64]:
    """float64 [H, W], mean over RGB of the squared difference of sRGB values in [0,1].

    Args:
        image: uint8 [H, W, 3], sRGB.
        exact: uint8 [H, W, 3], sRGB, the picture it is compared with.
    """
    difference = (image.astype(np.float64) - exact.astype(np.float64)) / 255.0
    return np.asarray(np.mean(difference * difference, axis=-1))


def worst_spot(error: NDArray[np.float64], spot: tuple[int, int]) -> tuple[slice, slice]:
    """The window of a picture with the largest sum of errors.

    Args:
        error: float64 [H, W], 0 or more.
        spot: Rows and columns; smaller where the picture is.
    """
    rows, columns = (min(side, most) for side, most in zip(spot, error.shape, strict=True))
    sums = np.pad(error.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    windows = sums[rows:, columns:] - sums[:-rows, columns:] - sums[rows:, :-columns] + sums[:-rows, :-columns]
    y, x = (int(i) for i in np.unravel_index(np.argmax(windows), windows.shape))
    return slice(y, y + rows), slice(x, x + columns)


def data_uri(image: NDArray[np.uint8], quality: int) -> str:
    """A picture uint8 [H, W, 3] as a data URI (WebP, `quality` in percent).

    Args:
        image: uint8 [H, W, 3], sRGB.
        quality: Of the compression, percent.
    """
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="WEBP", quality=quality, method=2)
    return "data:image/webp;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def _plate(s: PictureSet) -> Plate:
    names = technique_order(s.techniques)
    shown = {name: s.techniques[name] for name in names}
    where = f"{s.scene}, {s.view}, F = {s.budget_factor:g} W H"
    errors = {name: squared_error(picture.image, s.exact) for name, picture in shown.items()}
    strips = [
        Strip(
            "Picture",
            [_cell(s.exact, "exact", where, 90), *(_cell(p.image, title(n), where, 90) for n, p in shown.items())],
        ),
        _error_strip(errors, where),
        _flip_strip(shown, where),
    ]
    if any(picture.k is not None for picture in shown.values()):
        strips.append(_count_strip(shown, where))
    return Plate(s.scene, s.view, s.budget_factor, ["exact", *map(title, names)], strips)


def _error_strip(errors: Mapping[str, NDArray[np.float64]], where: str) -> Strip:
    low, high = ERROR_RANGE
    cells: list[Cell | None] = [None]
    for name, error in errors.items():
        scaled = np.log(np.maximum(error, low) / low) / np.log(high / low)
        caption = f"mean {error.mean() * 1e5:.3g}e-5"
        cells.append(_map_cell(scaled, colours.HEAT, f"{title(name)}: squared error", caption, where))
    return Strip("Squared error, log scale", cells, colours.css_gradient(colours.HEAT), f"≤ {low:.0e}", f"{high:.0e}")


def _flip_strip(shown: Mapping[str, Picture], where: str) -> Strip:
    cells: list[Cell | None] = [None]
    for name, picture in shown.items():
        caption = f"mean {float(picture.flip.mean()):.3g}"
        # Most errors are small: on a linear scale a map whose mean is .02 is black.
        cells.append(_map_cell(np.sqrt(picture.flip), colours.HEAT, f"{title(name)}: FLIP", caption, where))
    heading = "FLIP at 67.02 pixels per degree, square-root scale"
    return Strip(heading, cells, colours.css_gradient(colours.HEAT), "0", "1")


def _count_strip(shown: Mapping[str, Picture], where: str) -> Strip:
    # One pixel with a very long list would darken all others, so the scale ends at the 99.5th percentile.
    counts = [picture.k for picture in shown.values() if picture.k is not None]
    high = max(1, *(int(np.percentile(k, 99.5)) for k in counts))
    cells: list[Cell | None] = [None]
    for name, picture in shown.items():
        if picture.k is None:
            cells.append(None)
            continue
        caption = f"{int(picture.k.min())} to {int(picture.k.max())}"
        cells.append(_map_cell(picture.k / high, colours.COUNT, f"{title(name)}: k", caption, where))
    return Strip("Core fragments k", cells, colours.css_gradient(colours.COUNT), "0", f"≥ {high}")


def _cell(image: NDArray[np.uint8], name: str, where: str, quality: int) -> Cell:
    return Cell(data_uri(image, quality), "", f"{name}: {where}")


def _map_cell(values: NDArray[np.floating], anchors: colours.Anchors, name: str, caption: str, where: str) -> Cell:
    return Cell(data_uri(colours.apply(values, anchors), 75), caption, f"{name}: {where}")
