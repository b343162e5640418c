"""UDIM tiles: one image for each unit square of the texture coordinates, put side by side into one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pxr import Sdf, Usd, UsdShade

FIRST, COLUMNS = 1001, 10
"""Number of the tile at [0,1] x [0,1], and how many are in a row (UsdPreviewSurface: within [1001, 1100])."""

Vec3 = tuple[float, float, float]
Grid = tuple[int, int, int, int]


def is_udim(path: str) -> bool:
    """Whether an asset path stands for tiles."""
    return bool(UsdShade.UdimUtils.IsUdimIdentifier(path))


def tiles_of(path: str, attribute: Usd.Attribute, time: Usd.TimeCode) -> tuple[tuple[int, str], ...]:
    """Numbers and resolved paths of the tiles that exist.

    Args:
        path: Asset path with `<UDIM>`, as authored.
        attribute: Where it is authored: its layer is what the path is relative to.
        time: The time it was read at.
    """
    stack = attribute.GetPropertyStack(time)
    layer = stack[0].layer if stack else Sdf.Layer()
    found = UsdShade.UdimUtils.ResolveUdimTilePaths(path, layer)
    return tuple((int(number), str(resolved)) for resolved, number in found)


def grid_of(numbers: Iterable[int]) -> Grid:
    """First column, first row, columns and rows of the tiles with these numbers."""
    places = [_place(number) for number in numbers]
    low, high = (tuple(pick(place[axis] for place in places) for axis in (0, 1)) for pick in (min, max))
    return low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1


def atlas(tiles: Mapping[int, NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """One image of all tiles, uint8 [H, W, 4]; every tile as large as the largest.

    Args:
        tiles: uint8 [h, w, 4] by number, row 0 at the bottom.
    """
    first_column, first_row, columns, rows = grid_of(tiles)
    side = max(max(pixels.shape[:2]) for pixels in tiles.values())
    whole = np.zeros((rows * side, columns * side, 4), dtype=np.uint8)
    for number, pixels in tiles.items():
        column, row = _place(number)
        left, low = (column - first_column) * side, (row - first_row) * side
        scaled = Image.fromarray(pixels, "RGBA").resize((side, side), Image.Resampling.BOX)
        whole[low : low + side, left : left + side] = np.asarray(scaled)
    return whole


def _place(number: int) -> tuple[int, int]:
    """Column and row of a tile."""
    return (number - FIRST) % COLUMNS, (number - FIRST) // COLUMNS


def to_atlas(transform: tuple[Vec3, Vec3], grid: Grid) -> tuple[Vec3, Vec3]:
    """A transform of texture coordinates, followed by the one from tiles to their atlas."""
    (a, b, c), (d, e, f) = transform
    column, row, columns, rows = grid
    return (a / columns, b / columns, (c - column) / columns), (d / rows, e / rows, (f - row) / rows)
