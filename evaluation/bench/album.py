"""Pictures of a benchmark: of each view the spot where techniques differ, as every one of them shows it.

A spot is where the first technique of the view that errs at all errs most; the others show the same one. Files stand
in the output folder, so that a run that goes on keeps those of the runs before.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from evaluation.bench.groups import said_technique
from evaluation.report.pictures import data_uri, squared_error, worst_spot
from evaluation.summary import e5
from evaluation.writing import replacing
from schemas.bench import BenchView, CellKey
from schemas.tail import DENSITY_G

FOLDER: Final = "pictures"
SPOT: Final = 64, 96
"""Rows and columns."""
_SPOT, _WHOLE, _EXACT = "spot.json", "view.png", "exact.png"
_WIDTH: Final = 480
"""Of the whole view, pixels."""
_FRAME: Final = 230, 30, 90


@dataclass(frozen=True, slots=True)
class Tile:
    """A picture: its data URI, its caption, what a reader who cannot see it is told, and whether it is the spot."""

    uri: str
    caption: str
    alternative: str
    is_spot: bool = True


@dataclass(frozen=True, slots=True)
class Sheet:
    """A view within a budget: the whole of it, then its spot as the exact picture and every technique show it."""

    title: str
    tiles: tuple[Tile, ...]


class Album:
    """The pictures of one view.

    Args:
        out: The benchmark's output folder.
        key: Of the view.
        exact: uint8 [H, W, 3], the exact picture, sRGB.
    """

    def __init__(self, out: Path, key: str, exact: NDArray[np.uint8]) -> None:
        self._folder, self._exact = _folder(out, key), exact

    def keep(self, key: CellKey, image: NDArray[np.uint8]) -> None:
        """Keeps what a cell shows of the spot: of cells with a number of fragments, or without a budget.

        Args:
            key: The cell.
            image: uint8 [H, W, 3], sRGB.
        """
        if (name := _name(key)) is None:
            return
        spot = self._spot(image)
        if spot is not None:
            _save(self._folder / name, image[spot])

    def _spot(self, image: NDArray[np.uint8]) -> tuple[slice, slice] | None:
        path = self._folder / _SPOT
        if path.exists():
            (top, bottom), (left, right) = json.loads(path.read_text())
            return slice(top, bottom), slice(left, right)
        error = squared_error(image, self._exact)
        if not error.any():
            return None
        rows, columns = spot = worst_spot(error, SPOT)
        self._folder.mkdir(parents=True, exist_ok=True)
        _save(self._folder / _EXACT, self._exact[spot])
        whole = Image.fromarray(self._exact)
        box = columns.start, rows.start, columns.stop - 1, rows.stop - 1
        ImageDraw.Draw(whole).rectangle(box, outline=_FRAME, width=max(1, whole.width // 300))
        whole.thumbnail((_WIDTH, _WIDTH))
        _save(self._folder / _WHOLE, np.asarray(whole))
        with replacing(path) as new:  # last: with it the others are complete
            new.write_text(json.dumps([[part.start, part.stop] for part in spot]))
        return spot


def sheet_of(out: Path, views: Sequence[BenchView]) -> Sheet | None:
    """The view of the largest error that has pictures, at the middle one of its budgets; None: none has any.

    Args:
        out: The benchmark's output folder.
        views: Of a scene.
    """
    pictured = [view for view in views if (_folder(out, view.key) / _SPOT).exists()]
    if not pictured:
        return None
    view = max(pictured, key=lambda view: max((cell.mse or 0.0 for cell in view.cells), default=0.0))
    factors = sorted({cell.budget_factor for cell in view.cells if cell.budget_factor and cell.basis == "fragments"})
    return _sheet(out, view, factors[len(factors) // 2] if factors else None)


def _sheet(out: Path, view: BenchView, factor: float | None) -> Sheet:
    folder = _folder(out, view.key)
    tiles = [
        Tile(_uri(folder / _WHOLE), f"{view.view}, exact; framed: the spot", f"{view.view}: exact", is_spot=False),
        Tile(_uri(folder / _EXACT), "exact", f"{view.view}, spot: exact"),
    ]
    for cell in view.cells:
        name = _name(cell.key)
        if (
            cell.mse
            and cell.family != "exact"
            and cell.budget_factor in (None, factor)
            and name is not None
            and (folder / name).exists()
        ):
            title = said_technique(cell.key)
            tiles.append(Tile(_uri(folder / name), f"{title}: MSE {e5(cell.mse)}e-5", f"{view.view}, spot: {title}"))
    return Sheet(view.view if factor is None else f"{view.view} within F = {factor:g} WH", tuple(tiles))


def _folder(out: Path, key: str) -> Path:
    return out / FOLDER / key[:16]


def _name(key: CellKey) -> str | None:
    if key.basis == "memory" or key.g not in (None, DENSITY_G):
        return None
    budget = "" if key.budget_factor is None else f"{key.budget_factor:g}"
    parts = key.technique, key.tail or "", budget
    return "_".join(part for part in parts if part) + ".png"


def _save(path: Path, image: NDArray[np.uint8]) -> None:
    with replacing(path) as new:
        Image.fromarray(image).save(new, format="PNG")


def _uri(path: Path) -> str:
    with Image.open(path) as image:
        return data_uri(np.asarray(image), 92)
