"""What `depth-peeling` and `dual-depth-peeling` share: the loop of geometry passes, and the state between them.

Both take fragments in the order of the keys (depth, packed colour) of the sorted dump. A pass gathers, at the depth
being taken, the next colour and how many fragments are left there, and the next depth. Where one fragment is left, as
nearly everywhere, the pixel goes on to the next depth after one pass; of several, one colour is taken a pass, and how
often it occurs is what the next pass finds missing. So a pixel needs at most one pass a fragment, ties included. Depths
are compared by the bits of the float32 view depth with atomic minima, since depth buffers of few bits make ties.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer import timing
from renderer.frame import Clock, Frame
from renderer.screen import read_linear
from renderer.techniques.bands import equal_rows, in_bands, listed, over_pixels
from renderer.techniques.base import Rendered
from renderer.techniques.skips import frame_skips

SIDE = np.dtype([(name, "<u4") for name in ("depth", "taken", "left", "next_depth", "next_colour", "remaining")])
"""`Side` of depth-peeling/side.glsl."""
LIGHT_BYTES = 16
"""Premultiplied RGB and transmittance of what is composited on a side, float32."""
OVER = 0xFFFFFFFF
"""As a depth: nothing is left on this side."""

# Storage bindings of */peel.frag, */step.comp and */resolve.frag.
_SIDES, _LIGHT, _PIXELS, _ACTIVE = range(4)


def render_peeled(frame: Frame, shaders: str, sides: int) -> Rendered:
    """Peel every pixel until nothing is left.

    Args:
        frame: The view.
        shaders: Folder of the shaders.
        sides: 1: from the front; 2: from both sides.

    Returns:
        The exact picture.
    """
    n = frame.count()
    clock = Clock(frame.ctx)

    def store(first: int, rows: int) -> list[moderngl.Buffer]:
        return _peel(frame, clock, shaders, sides, first, rows)

    resolve = f"{shaders}/resolve.frag"
    image = in_bands(frame, clock, equal_rows(frame, sides), SIDE.itemsize, store, resolve)
    return Rendered(
        linear=read_linear(frame, image),
        k=n.astype(np.int32),
        passes={**frame.passes("opaque", "count"), **clock.passes},
        captured=int(n.sum(dtype=np.int64)),
        pool_bytes=0,
        pixel_bytes=12 + sides * (SIDE.itemsize + LIGHT_BYTES) + 4,
        skips=frame_skips(frame),
    )


def _peel(frame: Frame, clock: Clock, shaders: str, sides: int, first: int, rows: int) -> list[moderngl.Buffer]:
    begin, end = first * frame.width, (first + rows) * frame.width
    n = frame.count()[begin:end]
    with clock.measure("start"):
        occupied = listed(frame, first, rows, above=0)
        light = np.tile(np.array([0.0, 0.0, 0.0, 1.0], dtype=np.float32), sides * len(n))
        state = _first_state(frame, sides, begin, end)
        buffers = [
            frame.ctx.buffer(array) for array in (state, light, occupied if len(occupied) else np.zeros(1, "u4"))
        ]
        buffers.append(frame.buffer(1, 0))
        for binding, buffer in enumerate(buffers):
            buffer.bind_to_storage_buffer(binding)
    # The loop ends before it has gone through all n, where keys are equal or both sides are peeled.
    for _ in range(int(n.max())):
        with clock.measure("peel"):
            target = frame.target([])
            frame.draw_transparent(f"{shaders}/peel.frag", target, scissor=(first, rows), first_row=first)
            frame.ctx.memory_barrier()
        with clock.measure("step"):
            if not _step(frame, f"{shaders}/step.comp", len(occupied), buffers[_ACTIVE]):
                break
    return buffers


def _first_state(frame: Frame, sides: int, begin: int, end: int) -> NDArray[np.void]:
    """Sides [(end - begin) * sides]: the nearest depth, and from behind the farthest one; `OVER` where nothing is."""
    _, z_min, z_max = frame.depth_range()
    with timing.readback(frame.ctx):
        nearest, farthest = (
            np.frombuffer(buffer.read(4 * (end - begin), offset=4 * begin), dtype=np.uint32)
            for buffer in (z_min, z_max)
        )
    state = np.zeros((end - begin, sides), dtype=SIDE)
    state["next_depth"] = state["next_colour"] = OVER
    state["depth"] = np.stack([nearest, ~farthest], axis=1)[:, :sides]
    return state.reshape(-1)


def _step(frame: Frame, shader: str, pixels: int, active: moderngl.Buffer) -> int:
    """Composite what a pass has found; how many pixels are not finished."""
    active.write(np.zeros(1, dtype=np.uint32))
    over_pixels(frame, shader, pixels)
    with timing.readback(frame.ctx):
        return int(np.frombuffer(active.read(), dtype=np.uint32)[0])
