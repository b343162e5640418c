"""Between which depths the depth bins of a pixel lie: the range of its tile (METHOD section 2).

A range of each pixel's own would be nearer, at 12 bytes per pixel and a geometry pass of its own; that of a tile of
`RANGE_TILE` squared pixels is 64 times smaller, and can be estimated at a quarter of the resolution
(`shaders/range/range.frag`). What lies outside of an estimate counts as at its end: a wrong range costs quality and
never correctness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.tail import RANGE_TILE

STEPS: Final = 2
"""Pixels across a tile that its range is estimated from."""


@dataclass(frozen=True, slots=True)
class PixelRanges:
    """Where the depth bins of every pixel lie.

    Attributes:
        nearest: float32 [P], where they begin, metres.
        extent: float32 [P], from there to their end, >= 0.
    """

    nearest: NDArray[np.float32]
    extent: NDArray[np.float32]


def tile_grid(width: int, height: int) -> tuple[int, int]:
    """Columns and rows of the tiles of a picture."""
    return -(-width // RANGE_TILE), -(-height // RANGE_TILE)


def pixel_ranges(dump: FragmentDump) -> PixelRanges:
    """Where the depth bins of a dump's pixels lie: the range that was found for their tile, or its fragments'."""
    columns, _ = tile_grid(dump.width, dump.height)
    ranges = tile_ranges(dump)
    tile = np.arange(dump.height)[:, None] // RANGE_TILE * columns + np.arange(dump.width) // RANGE_TILE
    nearest, farthest = ranges[tile.ravel()].T
    return PixelRanges(np.ascontiguousarray(nearest), farthest - nearest)


def tile_ranges(dump: FragmentDump) -> NDArray[np.float32]:
    """float32 [T, 2], nearest and farthest depth of a dump's tiles: as they were found, or those of the fragments.

    Raises:
        Problem: Those that were found are not one pair of finite numbers a tile, which compiled code relies on.
    """
    columns, rows = tile_grid(dump.width, dump.height)
    if dump.tile_range is not None:
        found = dump.tile_range
        if not (found.shape == (rows * columns, 2) and found.dtype == np.float32 and bool(np.isfinite(found).all())):
            raise Problem(
                "The fragment dump is malformed: its tiles have no ranges of depths.", "Render the view again."
            )
        return found
    ranges = np.zeros((rows * columns, 2), dtype=np.float32)
    occupied = np.flatnonzero(dump.counts)
    tile = occupied // dump.width // RANGE_TILE * columns + occupied % dump.width // RANGE_TILE
    ranges[tile, 0] = np.inf
    np.minimum.at(ranges[:, 0], tile, dump.depth[dump.offsets[occupied]])
    np.maximum.at(ranges[:, 1], tile, dump.depth[dump.offsets[occupied + 1] - 1])
    return ranges
