"""Tiles of a window by their fullest pixel, on the GPU: what passes over pixels visit, and with which shader."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from renderer.gpu_scene import set_uniforms
from renderer.programs import Programs

TILE = 16
"""Pixels of a tile's side."""

_COUNTS, _TILES = range(2)
"""Storage bindings of `common/tiles.comp`."""


@dataclass(frozen=True, slots=True)
class Tiles:
    """The tiles of a window.

    Attributes:
        most: uint32 [rows * columns], row by row: the fragments of each tile's fullest pixel.
        columns: Tiles in a row.
        size: Width and height of the window, pixels.
    """

    most: moderngl.Buffer
    columns: int
    size: tuple[int, int]

    def __len__(self) -> int:
        """Rows times columns."""
        return int(self.most.size) // 4

    def empty(self) -> int:
        """How many have no fragment. It is read back: a statistic, for after a frame."""
        return int(np.count_nonzero(np.frombuffer(self.most.read(), dtype=np.uint32) == 0))


def tiles_of(ctx: moderngl.Context, programs: Programs, counts: moderngl.Buffer, width: int, height: int) -> Tiles:
    """The tiles of a window.

    Args:
        ctx: The context.
        programs: Of the context.
        counts: uint32 [P] or longer, n(p).
        width: Pixels per row.
        height: Rows.
    """
    rows, columns = -(-height // TILE), -(-width // TILE)
    tiles = Tiles(ctx.buffer(reserve=4 * rows * columns), columns, (width, height))
    counts.bind_to_storage_buffer(_COUNTS)
    tiles.most.bind_to_storage_buffer(_TILES)
    program = programs.compute("common/tiles.comp", {"TILE": TILE})
    set_uniforms(program, {"width": width, "height": height})
    program.run(-(-len(tiles) // 64))
    ctx.memory_barrier()
    return tiles
