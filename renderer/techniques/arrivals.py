"""Which fragments come before a pool of the whole frame is full: what engines do whose lists share one.

Fragments arrive by triangle, in the order of submission, and those of a triangle by pixel, row by row. A device runs
neighbouring triangles at once, so that the last ones that fit are mixed with the first that do not, differently from
frame to frame; here the line between them is sharp.
"""

from __future__ import annotations

from renderer.frame import Clock, Frame
from renderer.prefix import prefix_sums

_FIRST, _BEFORE = 3, 4
"""Storage bindings of arrivals/* and ordered/arrived.glsl."""


class Arrivals:
    """The line between the fragments that a pool has room for and the others, on the GPU: two geometry passes.

    Args:
        frame: The view.
        clock: Gets the pass `arrivals`.
        slots: Of the pool.
    """

    def __init__(self, frame: Frame, clock: Clock, slots: int) -> None:
        ctx, programs = frame.ctx, frame.gpu.programs
        triangles = len(frame.gpu.scene.indices) // 3
        with clock.measure("arrivals"):
            submitted, marks = frame.buffer(triangles + 1, 0), frame.buffer(frame.pixels + 1, 0)
            submitted.bind_to_storage_buffer(_FIRST)
            frame.draw_transparent("arrivals/count.frag", frame.target([]), ranked=True)
            ctx.memory_barrier()
            self._first, _ = prefix_sums(ctx, programs, submitted, triangles, into=submitted)
            self._first.bind_to_storage_buffer(_FIRST)
            marks.bind_to_storage_buffer(_BEFORE)
            frame.draw_transparent("arrivals/mark.frag", frame.target([]), ranked=True, slots=slots)
            ctx.memory_barrier()
            self._before, _ = prefix_sums(ctx, programs, marks, frame.pixels, into=marks)

    @property
    def nbytes(self) -> int:
        """Bytes of both buffers."""
        return self._first.size + self._before.size

    def bind(self) -> None:
        """Bind both for `ordered/arrived.glsl`."""
        self._first.bind_to_storage_buffer(_FIRST)
        self._before.bind_to_storage_buffer(_BEFORE)
