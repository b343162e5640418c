"""Text upon a picture: the read-out, and the list of keys.

Pillow draws it with the font that it brings along, into the same array that goes to the screen or to a file: nothing
needs installing beside what writes the pictures, and a window shows what its screenshot has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from evaluation.report.colours import Anchors, apply

Corner = Literal["top-left", "top-right", "bottom-left", "bottom-right", "middle"]

_SIZE, _LINE = 13, 17
"""Height of the letters and of a line, pixels."""
_MARGIN, _PADDING = 6, 5
_INK = (255, 255, 255)
_SHADE = 0.35
"""What is left of the picture's light behind text."""
_BAR = (160, 8)
"""Width and height of a colour bar."""


@dataclass(frozen=True, slots=True)
class Note:
    """A block of text.

    Attributes:
        lines: From top to bottom; columns are separated by a tab.
        corner: Where it stands.
        left: First column of the picture's part that it stands in.
        width: Of that part.
        bar: Colours of a bar under it; none: no bar.
    """

    lines: Sequence[str]
    corner: Corner
    left: int
    width: int
    bar: Anchors = ()


def draw(image: NDArray[np.uint8], notes: Sequence[Note]) -> NDArray[np.uint8]:
    """A picture with text upon it.

    Args:
        image: uint8 [H, W, 3], sRGB; not changed.
        notes: What is written, later ones over earlier ones; what is too large for its part is cut off.
    """
    if not notes:
        return image
    drawn = image.copy()
    for note in notes:
        across, down = _extent(note)
        x, y = _place(note, across, down, image.shape[0])
        # Not beyond its own part: what stands beside it would be covered.
        area = drawn[y : y + down, x : min(x + across, note.left + note.width)]
        if area.size:
            area[:] = _written(area, note)
    return drawn


def _written(area: NDArray[np.uint8], note: Note) -> NDArray[np.uint8]:
    """The part of a picture behind a note, shaded, with as much of the note as it has room for."""
    shaded = (_SHADE * area).astype(np.uint8)
    if note.bar:
        top = _PADDING + _LINE * len(note.lines) + 2
        part = shaded[top : top + _BAR[1], _PADDING : _PADDING + _BAR[0]]
        part[:] = apply(np.linspace(0.0, 1.0, _BAR[0]), note.bar)[: part.shape[1]]
    picture = Image.fromarray(shaded)
    pen = ImageDraw.Draw(picture)
    for number, line in enumerate(note.lines):
        for column, text in zip(_columns(note), line.split("\t"), strict=False):
            pen.text((_PADDING + column, _PADDING + number * _LINE), text, font=_font(), fill=_INK)
    return np.asarray(picture)


def in_columns(lines: Sequence[str], height: int) -> list[str]:
    """Lines side by side, as many blocks of them as a picture of `height` rows needs."""
    fitting = max((height - 2 * _PADDING) // _LINE, 1)
    blocks = -(-len(lines) // fitting)
    rows = -(-len(lines) // blocks)
    return ["\t".join(lines[first::rows]) for first in range(rows)]


def _place(note: Note, across: int, down: int, height: int) -> tuple[int, int]:
    """Where a block's top left corner is."""
    right, bottom = note.left + note.width - across, height - down
    x, y = {
        "top-left": (note.left + _MARGIN, _MARGIN),
        "top-right": (right - _MARGIN, _MARGIN),
        "bottom-left": (note.left + _MARGIN, bottom - _MARGIN),
        "bottom-right": (right - _MARGIN, bottom - _MARGIN),
        "middle": ((note.left + right) // 2, bottom // 2),
    }[note.corner]
    return max(x, note.left), max(y, 0)


def _extent(note: Note) -> tuple[int, int]:
    """Width and height of a block, pixels."""
    starts = _columns(note)
    across = max(
        start + _length(text) for line in note.lines for start, text in zip(starts, line.split("\t"), strict=False)
    )
    bar = _BAR if note.bar else (0, -2)
    return max(across, bar[0]) + 2 * _PADDING, _LINE * len(note.lines) + bar[1] + 2 + 2 * _PADDING


def _columns(note: Note) -> list[int]:
    """Where each column of text begins, pixels from the first one."""
    rows = [line.split("\t") for line in note.lines]
    starts = [0]
    for column in range(max(len(row) for row in rows) - 1):
        # A line without columns may be wider than all others.
        widest = max(_length(row[column]) for row in rows if len(row) > column + 1)
        starts.append(starts[-1] + widest + 2 * _PADDING)
    return starts


def _length(text: str) -> int:
    return int(np.ceil(_font().getlength(text)))


@cache
def _font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(_SIZE)
