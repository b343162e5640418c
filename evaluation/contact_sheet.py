"""A contact sheet: the pictures of one view by several techniques, each above the map of its errors."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from evaluation.report import colours
from evaluation.report.pictures import ERROR_RANGE, squared_error

CELL_WIDTH = 320
"""Pixels of a picture's row on the sheet at most."""
GAP = 12
LINE = 18
"""Pixels between two lines of text."""

_PAPER, _INK, _QUIET = (255, 255, 255), (20, 20, 20), (95, 95, 95)


@dataclass(frozen=True, slots=True)
class _Cell:
    rank: tuple[float, float]
    title: str
    caption: str
    picture: NDArray[np.uint8]
    errors: NDArray[np.uint8]


@dataclass(slots=True)
class ContactSheet:
    """The sheet of one view.

    Attributes:
        heading: What it shows.
        cells: What is on it so far.
    """

    heading: str
    cells: list[_Cell] = field(default_factory=list)

    def add(
        self,
        title: str,
        caption: str,
        image: NDArray[np.uint8],
        exact: NDArray[np.uint8],
        rank: tuple[float, float],
    ) -> None:
        """Adds a picture.

        Args:
            title: Of the technique.
            caption: What it cost.
            image: uint8 [H, W, 3], display sRGB.
            exact: The exact picture, the same.
            rank: Pictures stand in the order of this.
        """
        low, high = ERROR_RANGE
        scaled = np.log(np.maximum(squared_error(image, exact), low) / low) / np.log(high / low)
        self.cells.append(_Cell(rank, title, caption, _small(image), _small(colours.apply(scaled, colours.HEAT))))

    def image(self) -> NDArray[np.uint8]:
        """The sheet, uint8 [H, W, 3], display sRGB: the least errors first, row by row."""
        cells = sorted(self.cells, key=lambda cell: cell.rank)
        height, width = cells[0].picture.shape[:2]
        columns = min(len(cells), max(1, math.ceil(math.sqrt(len(cells) * 2.0 * height / width))))
        cell_width, cell_height = max(width, CELL_WIDTH) + GAP, 2 * height + 2 * LINE + 2 * GAP
        rows = math.ceil(len(cells) / columns)
        sheet = Image.new("RGB", (columns * cell_width + GAP, rows * cell_height + LINE + 2 * GAP), _PAPER)
        draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(13)
        low, high = ERROR_RANGE
        legend = f"{self.heading}; below each picture its squared error, {low:.0e} (black) to {high:.0e} (yellow)"
        draw.text((GAP, GAP), legend, _INK, font)
        for number, cell in enumerate(cells):
            x, y = GAP + number % columns * cell_width, LINE + 2 * GAP + number // columns * cell_height
            draw.text((x, y), cell.title, _INK, font)
            draw.text((x, y + LINE), cell.caption, _QUIET, font)
            sheet.paste(Image.fromarray(cell.picture), (x, y + 2 * LINE))
            sheet.paste(Image.fromarray(cell.errors), (x, y + 2 * LINE + height + GAP // 2))
        return np.asarray(sheet)


def _small(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = image.shape[:2]
    if width <= CELL_WIDTH:
        return image
    size = CELL_WIDTH, max(1, round(height * CELL_WIDTH / width))
    return np.asarray(Image.fromarray(image).resize(size, Image.Resampling.BOX))
