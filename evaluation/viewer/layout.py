"""How two pictures of one camera are put beside, upon and against each other: plain arrays, no GL.

Pictures are 8-bit sRGB, row 0 at the top. A heat map's colours are those of the report (`evaluation.report.colours`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from evaluation.report.colours import COUNT, HEAT, apply

Layout = Literal["single", "side-by-side", "split", "difference", "k"]
LAYOUTS: tuple[Layout, ...] = get_args(Layout)

DIVIDER = (255, 128, 0)
"""Colour of the line of `split`, a pixel wide."""
_UNKNOWN = 96
"""Grey of a picture that there is none of."""


@dataclass(frozen=True, slots=True)
class Pane:
    """A picture as it is shown.

    Attributes:
        image: uint8 [H, W, 3].
        k: int32 [H, W], fragments of each pixel that are kept apart.
    """

    image: NDArray[np.uint8]
    k: NDArray[np.int32]


def blank(width: int, height: int) -> Pane:
    """A pane without a picture."""
    return Pane(np.full((height, width, 3), _UNKNOWN, np.uint8), np.zeros((height, width), np.int32))


def across(layout: Layout) -> int:
    """How many panes lie beside each other."""
    return 2 if layout in ("side-by-side", "k") else 1


def is_paired(layout: Layout) -> bool:
    """Whether the right picture is part of it."""
    return layout != "single"


def compose(layout: Layout, left: Pane, right: Pane, split: float, gain: float, top: int) -> NDArray[np.uint8]:
    """The whole picture.

    Args:
        layout: `single`: the left one; `side-by-side`: both; `split`: the left one as far as the divider, then the
            right one; `difference`: heat map of how far they are apart; `k`: heat maps of both k on one scale.
        left: One pane.
        right: Another, of the same size.
        split: Where the divider is, as a share of the width.
        gain: What the difference is multiplied by.
        top: The k that has the brightest colour, at least 1.

    Returns:
        uint8 [H, W * across(layout), 3].
    """
    if layout == "side-by-side":
        return np.concatenate([left.image, right.image], axis=1)
    if layout == "split":
        return _split(left.image, right.image, split)
    if layout == "difference":
        return apply(gain * difference(left.image, right.image), HEAT)
    if layout == "k":
        return np.concatenate([apply(pane.k / top, COUNT) for pane in (left, right)], axis=1)
    return left.image


def difference(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float64]:
    """How far two pictures are apart: of each pixel the channel that differs most, [H, W] in [0,1], as displayed.

    Args:
        left: uint8 [H, W, 3], sRGB.
        right: uint8 [H, W, 3], sRGB.
    """
    apart = np.abs(left.astype(np.int16) - right.astype(np.int16)).max(axis=2)
    return np.asarray(apart / 255.0)


def _split(left: NDArray[np.uint8], right: NDArray[np.uint8], split: float) -> NDArray[np.uint8]:
    width = left.shape[1]
    column = round(min(max(split, 0.0), 1.0) * width)
    image = np.concatenate([left[:, :column], right[:, column:]], axis=1)
    if 0 < column < width:
        image[:, column] = DIVIDER
    return image
