"""`abuffer-array`: exact. As many slots for every pixel as the fullest one needs (Crassin 2010, F3D's A-buffer).

A counter a pixel gives each fragment the next slot. Arrays are sorted in place, by heapsort (the original sorts a local
array, whose size is a cap), and composited.

Memory is `8 max(n) P` bytes whatever most pixels need: what the S-buffer and the lists save.
"""

from __future__ import annotations

from typing import Any

import moderngl

from renderer.frame import Clock, Frame
from renderer.screen import TURNS, read_linear
from renderer.techniques.bands import (
    Part,
    check_most,
    count_pixels,
    count_totals,
    equal_parts,
    in_bands,
    over_pixels,
    read_counts,
)
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.chain import SLOT_BYTES
from renderer.techniques.skips import frame_skips

# Storage bindings of abuffer-array/*.
_USED, _SLOTS = range(2)
_PIXEL_BYTES = 4
"""n: the cursor of the array, once the fullest pixel is known."""


class ABufferArray(Technique):
    """Fixed per-pixel arrays."""

    name = "abuffer-array"
    family = "exact"
    about = "as many slots for every pixel as the fullest one needs"
    twin = Twin("exact")

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used.

        `pool_bytes` are those of the whole window; above the limit of a storage buffer, bands of rows use one part of
        that size after the other.

        Raises:
            Problem: One row of the window alone does not fit a storage buffer, or one pixel has more fragments than a
                shader can go through.
        """
        clock = Clock(frame.ctx)
        counted = count_pixels(frame, clock)
        total, slots = count_totals(frame, clock, counted.counts)
        check_most(slots)
        counted.counts.clear()  # from now on the cursors, which end as the counts

        def store(part: Part) -> list[moderngl.Buffer]:
            with clock.measure("array"):
                buffers = _arrays(frame, part, slots, counted.counts)
            with clock.measure("sort"):
                _sort(frame, part, slots)
            return buffers

        parts = equal_parts(frame, slots, SLOT_BYTES)
        image = in_bands(frame, clock, counted.tiles, parts, store, "abuffer-array/resolve.frag", slots=slots)
        linear = read_linear(frame, image)
        return Rendered(
            linear=linear,
            k=read_counts(frame, counted.counts),
            passes={**frame.passes("opaque"), **clock.passes},
            captured=total,
            pool_bytes=SLOT_BYTES * slots * frame.pixels,
            pixel_bytes=_PIXEL_BYTES,
            skips=frame_skips(frame, counted.tiles),
        )


def _arrays(frame: Frame, part: Part, slots: int, used: moderngl.Buffer) -> list[moderngl.Buffer]:
    """The arrays of some rows, bound; fragments in the order of arrival."""
    pool = frame.ctx.buffer(reserve=SLOT_BYTES * max(1, part.items))
    used.bind_to_storage_buffer(_USED)
    pool.bind_to_storage_buffer(_SLOTS)
    target, rows = frame.target([]), (part.first, part.rows)
    shader = "abuffer-array/append.frag"
    frame.draw_transparent(shader, target, scissor=rows, first_row=part.first, slots=slots)
    frame.ctx.memory_barrier()
    return [pool]


def _sort(frame: Frame, part: Part, slots: int) -> None:
    """Sort the bound arrays: a dispatch that makes heaps, then as many as it takes to empty them."""
    if slots < 2:
        return
    shader, pixels = "abuffer-array/sort.comp", part.rows * frame.width
    given: dict[str, Any] = {"slots": slots, "first_pixel": part.first * frame.width}
    over_pixels(frame, shader, pixels, **given, make=True)
    # Taking one is a turn, and one for each level of the heap.
    step = TURNS // (1 + slots.bit_length())
    for taken in range(0, slots, step):
        over_pixels(frame, shader, pixels, **given, make=False, first_taken=taken, last_taken=taken + step - 1)
