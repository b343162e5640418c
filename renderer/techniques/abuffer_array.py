"""`abuffer-array`: exact. As many slots for every pixel as the fullest one needs (Crassin 2010, F3D's A-buffer).

A counter a pixel gives each fragment the next slot. Arrays are sorted in place, by heapsort (the original sorts a local
array, whose size is a cap), and composited.

Memory is `8 max(n) P` bytes whatever most pixels need: what the S-buffer and the lists save.
"""

from __future__ import annotations

import moderngl

from renderer.frame import Clock, Frame
from renderer.screen import TURNS, read_linear
from renderer.techniques.bands import equal_rows, in_bands, listed, over_pixels
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import SLOT_BYTES
from renderer.techniques.skips import frame_skips

# Storage bindings of abuffer-array/*.
_USED, _SLOTS, _PIXELS = range(3)


class ABufferArray:
    """Fixed per-pixel arrays."""

    name = "abuffer-array"

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used.

        `pool_bytes` are those of the whole window; above the limit of a storage buffer, bands of rows use one part of
        that size after the other.

        Raises:
            Problem: One row of the window alone does not fit a storage buffer, or one pixel has more fragments than a
                shader can go through.
        """
        n = frame.count()
        slots = int(n.max())
        clock = Clock(frame.ctx)

        def store(first: int, rows: int) -> list[moderngl.Buffer]:
            with clock.measure("array"):
                buffers = _arrays(frame, first, rows, slots)
            with clock.measure("sort"):
                _sort(frame, first, rows, slots)
            return buffers

        ends = equal_rows(frame, slots)
        image = in_bands(frame, clock, ends, SLOT_BYTES, store, "abuffer-array/resolve.frag", slots=slots)
        return Rendered(
            linear=read_linear(frame, image),
            k=n.astype("i4"),
            passes={**frame.passes("opaque", "count"), **clock.passes},
            captured=int(n.sum(dtype="i8")),
            pool_bytes=SLOT_BYTES * slots * frame.pixels,
            pixel_bytes=12 + 4 + 4,
            skips=frame_skips(frame),
        )


def _arrays(frame: Frame, first: int, rows: int, slots: int) -> list[moderngl.Buffer]:
    """The arrays of some rows, bound; fragments in the order of arrival."""
    used = frame.buffer(rows * frame.width, 0)
    pool = frame.ctx.buffer(reserve=SLOT_BYTES * max(1, rows * frame.width * slots))
    used.bind_to_storage_buffer(_USED)
    pool.bind_to_storage_buffer(_SLOTS)
    target = frame.target([])
    frame.draw_transparent("abuffer-array/append.frag", target, scissor=(first, rows), first_row=first, slots=slots)
    frame.ctx.memory_barrier()
    return [used, pool]


def _sort(frame: Frame, first: int, rows: int, slots: int) -> None:
    """Sort the bound arrays: a dispatch that makes heaps, then as many as it takes to empty them."""
    pixels = listed(frame, first, rows, above=1)
    if len(pixels) == 0:
        return
    pixel_list = frame.ctx.buffer(pixels)
    pixel_list.bind_to_storage_buffer(_PIXELS)
    over_pixels(frame, "abuffer-array/sort.comp", len(pixels), slots=slots, make=True)
    # Taking one is a turn, and one for each level of the heap.
    step = TURNS // (1 + slots.bit_length())
    for taken in range(0, slots, step):
        uniforms = {"slots": slots, "make": False, "first_taken": taken, "last_taken": taken + step - 1}
        over_pixels(frame, "abuffer-array/sort.comp", len(pixels), **uniforms)
