"""What the exact techniques share: bands of rows that fit a storage buffer, and compute passes over listed pixels."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.bands import row_bands
from renderer.frame import Clock, Frame
from renderer.gpu_scene import set_uniforms
from renderer.programs import Defines
from renderer.screen import TURNS, resolve_screen
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem

MOST_FRAGMENTS = TURNS // 3
"""Of one pixel: one level of the lists' merge sort takes up to 2.5 turns a fragment."""

_GROUP = 64
_DISPATCH = 65535 * _GROUP
"""Pixels of one dispatch: the least maximum of work groups that GL promises."""

Store = Callable[[int, int], list[moderngl.Buffer]]
"""Renders some rows (the first, how many) into bound buffers, which it returns: they are released once resolved."""


def in_bands(
    frame: Frame,
    clock: Clock,
    ends: NDArray[np.integer],
    item_bytes: int,
    store: Store,
    resolve: str,
    defines: Defines | None = None,
    **uniforms: object,
) -> moderngl.Texture:
    """Store and resolve the window, as few bands of rows as fit.

    Args:
        frame: The view.
        clock: Gets the pass `resolve`.
        ends: int64 [H+1], items stored in the rows before each.
        item_bytes: Bytes of an item in the largest buffer.
        store: Stores a band.
        resolve: Fragment shader, as for `resolve_screen`; it reads what `store` has bound, and has `first_row`.
        defines: For the shader.
        uniforms: For the shader.

    Returns:
        RGBA32F, linear.

    Raises:
        Problem: A pixel has too many fragments for one shader, or one row alone does not fit a storage buffer.
    """
    most = int(frame.count().max())
    if most > MOST_FRAGMENTS:
        raise Problem(
            f"A pixel has {most:,} transparent fragments; this technique can order {MOST_FRAGMENTS:,}.",
            "Use sbuffer.",
            ExitCode.LIMIT,
        )
    image = frame.ctx.texture((frame.width, frame.height), 4, dtype="f4")
    bands = row_bands(np.asarray(ends, dtype=np.int64), 1, LIMITS.buffer_bytes // item_bytes)
    for first, rows in bands or [(0, frame.height)]:
        buffers = store(first, rows)
        with clock.measure("resolve"):
            band = (image, first, rows)
            resolve_screen(frame, resolve, [frame.background], defines, band, first_row=first, **uniforms)
        for buffer in buffers:
            buffer.release()
    return image


def equal_rows(frame: Frame, items: int) -> NDArray[np.int64]:
    """`ends` of `in_bands` where every pixel has the same number of items."""
    return np.arange(frame.height + 1, dtype=np.int64) * (frame.width * items)


def rows_of(offsets: NDArray[np.int64], frame: Frame) -> NDArray[np.int64]:
    """`ends` of `in_bands` for offsets int64 [P+1]."""
    return np.ascontiguousarray(offsets[:: frame.width])


def listed(frame: Frame, first: int, rows: int, above: int) -> NDArray[np.uint32]:
    """uint32 [M], pixels of a band (counted from its first) that have more than `above` fragments."""
    n = frame.count()[first * frame.width : (first + rows) * frame.width]
    return np.flatnonzero(n > above).astype(np.uint32)


def over_pixels(frame: Frame, shader: str, pixels: int, **uniforms: object) -> None:
    """Run a compute shader on a bound list of pixels.

    Args:
        frame: The view.
        shader: File of 64 invocations a group, with the uniforms `first` and `pixels`.
        pixels: Length of the list.
        uniforms: For the shader.
    """
    program = frame.gpu.programs.compute(shader)
    set_uniforms(program, {"pixels": pixels, **uniforms})
    for first in range(0, pixels, _DISPATCH):
        set_uniforms(program, {"first": first})
        program.run(-(-min(pixels - first, _DISPATCH) // _GROUP))
    frame.ctx.memory_barrier()
