"""Passes over pixels instead of triangles: only tiles in which something is transparent, the others get the background.

A tile is `TILE` x `TILE` pixels. Which are occupied is found and used on the GPU: a vertex shader leaves the others
out. Where nothing has counted the fragments, the window is one pass: a count would cost more than it saves. The picture
is the same.
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
from renderer.tiles import TILE, Tiles

TURNS = 60_000
"""Turns of all its loops that a shader may take: Mesa's software drivers end the loops after 65,535, in silence."""

BACKGROUND = "common/background.frag"
"""Draws what lies behind."""
ANY = 2**32 - 1
"""Fragments of a tile's fullest pixel, at most."""
OCCUPIED = (1, ANY)
"""Tiles with a fragment."""
NO_FRAGMENTS = (0, 0)
"""Tiles without one."""

Class = tuple[int, Defines]
"""For tiles whose fullest pixel has at most so many fragments: further defines."""


def resolve_screen(
    frame: Frame,
    fragment: str,
    textures: Sequence[moderngl.Texture],
    defines: Defines | None = None,
    band: tuple[moderngl.Texture, int, int] | None = None,
    tiles: Tiles | None = None,
    classes: Sequence[Class] = ((ANY, {}),),
    **uniforms: object,
) -> moderngl.Texture:
    """Run a fragment shader on every pixel of the occupied tiles.

    Args:
        frame: The view.
        fragment: File relative to `renderer/shaders`; writes linear RGBA to location 0.
        textures: Bound to units 0, 1, ... in order, as the shader's `layout(binding = ...)` say. NEAREST is set.
        defines: Shader defines.
        band: A texture of the window's size, first row and number of rows: only those rows of it are drawn.
        tiles: Of the window; None: those of the frame's count pass.
        classes: Ascending, the last for all tiles that are left: a shader that knows how few fragments there are is
            compiled apart.
        uniforms: Set where the shader has them; `width` is always given.

    Returns:
        RGBA32F, linear; the background where nothing is transparent.
    """
    tiles = tiles or frame.tiles
    image, first, rows = band or (frame.ctx.texture((frame.width, frame.height), 4, dtype="f4"), 0, frame.height)
    target = frame.ctx.framebuffer([image])
    target.use()
    target.scissor = (0, first, frame.width, rows)
    frame.ctx.enable_only(moderngl.NOTHING)
    for unit, texture in enumerate(textures):
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        texture.use(unit)
    if tiles is None:
        program = frame.gpu.programs.get("common/fullscreen.vert", fragment, defines)
        set_uniforms(program, {"width": frame.width, **uniforms})
        frame.ctx.vertex_array(program, []).render(moderngl.TRIANGLES, vertices=3)
        return image
    least = 1
    for greatest, further in classes:
        draw_tiles(frame, tiles, fragment, {**(defines or {}), **further}, (least, greatest), **uniforms)
        least = greatest + 1
    frame.background.use(0)
    draw_tiles(frame, tiles, BACKGROUND, most=NO_FRAGMENTS)
    return image


def draw_tiles(
    frame: Frame,
    tiles: Tiles,
    fragment: str,
    defines: Defines | None = None,
    most: tuple[int, int] = OCCUPIED,
    **uniforms: object,
) -> None:
    """Run a fragment shader on the tiles whose fullest pixel has so many fragments.

    Args:
        frame: The view.
        tiles: Of the viewport.
        fragment: File relative to `renderer/shaders`.
        defines: Shader defines.
        most: The least and the greatest number.
        uniforms: Set where the shader has them; `width` is always given.
    """
    program = frame.gpu.programs.get("common/tiles.vert", fragment, defines)
    set_uniforms(program, {"width": frame.width, **uniforms})
    set_uniforms(program, {"least": most[0], "greatest": most[1], "columns": tiles.columns})
    width, height = tiles.size
    set_uniforms(program, {"tile_size": (2.0 * TILE / width, 2.0 * TILE / height)})
    array = frame.ctx.vertex_array(program, [(tiles.most, "1u/i", "in_most")])
    array.render(moderngl.TRIANGLES, vertices=6, instances=len(tiles))


def read_linear(frame: Frame, image: moderngl.Texture) -> NDArray[np.float32]:
    """An RGBA32F texture as float32 [H, W, 3]."""
    with timing.readback(frame.ctx):
        rgba = np.frombuffer(image.read(), dtype=np.float32).reshape(frame.height, frame.width, 4)
        return np.ascontiguousarray(rgba[:, :, :3])
