"""Passes over pixels instead of triangles: only tiles in which something is transparent, the others get the background.

A tile is `TILE` x `TILE` pixels. Where nothing has counted the fragments yet, the window is one pass: a count would
cost more than it saves. The picture is the same.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer import timing
from renderer.frame import Frame
from renderer.gpu_scene import set_uniforms
from renderer.programs import Defines

TILE = 16
"""Pixels of a tile's side."""
TURNS = 60_000
"""Turns of all its loops that a shader may take: Mesa's software drivers end the loops after 65,535, in silence."""

_BACKGROUND = "common/background.frag"


def occupied_tiles(counts: NDArray[np.integer], width: int, height: int) -> NDArray[np.bool_]:
    """Which tiles have a transparent fragment.

    Args:
        counts: int [P], n(p).
        width: Pixels per row.
        height: Rows.

    Returns:
        bool [ceil(height / TILE), ceil(width / TILE)].
    """
    rows, columns = -(-height // TILE), -(-width // TILE)
    padded = np.zeros((rows * TILE, columns * TILE), dtype=bool)
    padded[:height, :width] = (np.asarray(counts) > 0).reshape(height, width)
    return np.asarray(padded.reshape(rows, TILE, columns, TILE).any(axis=(1, 3)))


def empty_tiles(frame: Frame) -> int:
    """Tiles that no pass over pixels visits; 0 where nothing was counted."""
    if not frame.counted:
        return 0
    return int((~occupied_tiles(frame.count(), frame.width, frame.height)).sum())


def resolve_screen(
    frame: Frame,
    fragment: str,
    textures: Sequence[moderngl.Texture],
    defines: Defines | None = None,
    band: tuple[moderngl.Texture, int, int] | None = None,
    **uniforms: object,
) -> moderngl.Texture:
    """Run a fragment shader on every pixel of the occupied tiles.

    Args:
        frame: The view.
        fragment: File relative to `renderer/shaders`; writes linear RGBA to location 0.
        textures: Bound to units 0, 1, ... in order, as the shader's `layout(binding = ...)` say. NEAREST is set.
        defines: Shader defines.
        band: A texture of the window's size, first row and number of rows: only those rows of it are drawn.
        uniforms: Set where the shader has them; `width` is always given.

    Returns:
        RGBA32F, linear; the background where nothing is transparent.
    """
    image, first, rows = band or (frame.ctx.texture((frame.width, frame.height), 4, dtype="f4"), 0, frame.height)
    target = frame.ctx.framebuffer([image])
    target.use()
    target.scissor = (0, first, frame.width, rows)
    frame.ctx.enable_only(moderngl.NOTHING)
    for unit, texture in enumerate(textures):
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.use(unit)
    if not frame.counted:
        _draw(frame, fragment, defines, uniforms, None)
        return image
    occupied = occupied_tiles(frame.count(), frame.width, frame.height)
    _draw(frame, fragment, defines, uniforms, occupied)
    frame.background.use(0)
    _draw(frame, _BACKGROUND, None, {}, ~occupied)
    return image


def _draw(
    frame: Frame, fragment: str, defines: Defines | None, uniforms: dict[str, object], tiles: NDArray[np.bool_] | None
) -> None:
    vertex = "common/fullscreen.vert" if tiles is None else "common/tiles.vert"
    program = frame.gpu.programs.get(vertex, fragment, defines)
    set_uniforms(program, {"width": frame.width, **uniforms})
    if tiles is None:
        frame.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
        return
    rows, columns = np.nonzero(tiles)
    if len(rows) == 0:
        return
    set_uniforms(program, {"tile_size": (2.0 * TILE / frame.width, 2.0 * TILE / frame.height)})
    corners = frame.ctx.buffer(np.stack((columns, rows), axis=1).astype(np.float32))
    array = frame.ctx.vertex_array(program, [(corners, "2f/i", "in_tile")])
    array.render(moderngl.TRIANGLES, vertices=6, instances=len(rows))


def read_linear(frame: Frame, image: moderngl.Texture) -> NDArray[np.float32]:
    """An RGBA32F texture as float32 [H, W, 3]."""
    with timing.readback(frame.ctx):
        rgba = np.frombuffer(image.read(), dtype=np.float32).reshape(frame.height, frame.width, 4)
        return np.ascontiguousarray(rgba[:, :, :3])
