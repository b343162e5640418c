"""`abuffer-list`: exact. A linked list of fragments a pixel (Yang et al. 2010, "Real-Time Concurrent Linked Lists").

One pass pushes every fragment on its pixel's list: an atomic counter gives it a node, an atomic exchange of the
pixel's head links it. Then the lists are sorted and composited.

Different from the paper: the count pass gives the exact size of the node pool (the paper guesses, and what does not
fit is lost); and lists are sorted by merging their links (the paper copies them to a local array, whose size is a cap).
"""

from __future__ import annotations

import moderngl

from renderer.csr import offsets_of
from renderer.frame import Clock, Frame
from renderer.screen import TURNS, read_linear
from renderer.techniques.bands import in_bands, listed, over_pixels, rows_of
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.skips import frame_skips

NODE_BYTES = 12
"""Packed colour, depth and the next node."""

_END = 0xFFFFFFFF
_TURNS_A_LEVEL = 3
"""Of the sort's loops, for each fragment, at most."""

# Storage bindings of abuffer-list/*; the sort has the list of pixels where the other passes have the counter of nodes.
_HEADS, _NODES, _USED, _COUNTS = range(4)
_PIXELS = _USED


class ABufferList:
    """Per-pixel linked lists."""

    name = "abuffer-list"

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used: the pool holds all N fragments.

        Raises:
            Problem: One row of the window alone has more fragments than a storage buffer holds, or one pixel has more
                than a shader can go through.
        """
        n = frame.count()
        offsets = offsets_of(n)
        clock = Clock(frame.ctx)

        def store(first: int, rows: int) -> list[moderngl.Buffer]:
            begin, end = first * frame.width, (first + rows) * frame.width
            with clock.measure("list"):
                buffers = _lists(frame, first, rows, int(offsets[end] - offsets[begin]))
            with clock.measure("sort"):
                _sort(frame, first, rows, int(n[begin:end].max()))
            return buffers

        image = in_bands(frame, clock, rows_of(offsets, frame), NODE_BYTES, store, "abuffer-list/resolve.frag")
        total = int(offsets[-1])
        return Rendered(
            linear=read_linear(frame, image),
            k=n.astype("i4"),
            passes={**frame.passes("opaque", "count"), **clock.passes},
            captured=total,
            pool_bytes=NODE_BYTES * total,
            pixel_bytes=12 + 4 + 4,
            skips=frame_skips(frame),
        )


def _lists(frame: Frame, first: int, rows: int, total: int) -> list[moderngl.Buffer]:
    """The lists of some rows, bound; nodes in the order of arrival, backwards."""
    heads, used = frame.buffer(rows * frame.width, _END), frame.buffer(1, 0)
    nodes = frame.ctx.buffer(reserve=NODE_BYTES * max(1, total))
    for binding, buffer in ((_HEADS, heads), (_NODES, nodes), (_USED, used)):
        buffer.bind_to_storage_buffer(binding)
    frame.draw_transparent("abuffer-list/append.frag", frame.target([]), scissor=(first, rows), first_row=first)
    frame.ctx.memory_barrier()
    return [heads, nodes]


def _sort(frame: Frame, first: int, rows: int, most: int) -> None:
    """Sort the bound lists, of up to `most` fragments: a dispatch for as many levels as its loops may take turns."""
    pixels = listed(frame, first, rows, above=1)
    if len(pixels) == 0:
        return
    pixel_list = frame.ctx.buffer(pixels)
    pixel_list.bind_to_storage_buffer(_PIXELS)
    frame.depth_range()[0].bind_to_storage_buffer(_COUNTS)
    levels = max(1, TURNS // (_TURNS_A_LEVEL * most))
    run = 1
    while run < most:
        last = run << min(levels - 1, 30)
        uniforms = {"first_pixel": first * frame.width, "first_run": run, "last_run": min(last, 1 << 30)}
        over_pixels(frame, "abuffer-list/sort.comp", len(pixels), **uniforms)
        run = 2 * last
