"""`abuffer-list`: exact. A linked list of fragments per pixel (Yang et al. 2010, "Real-Time Concurrent Linked Lists").

One pass pushes every fragment on its pixel's list: an atomic counter gives it a node, an atomic exchange of the
pixel's head links it. Then the lists are sorted and composited.

Different from the paper: the count pass gives the exact size of the node pool (the paper guesses, and what does not
fit is lost); and lists are sorted by merging their links (the paper copies them to a local array, whose size is a cap).
"""

from __future__ import annotations

import moderngl

from renderer.frame import Clock, Frame
from renderer.screen import TURNS, read_linear
from renderer.techniques.bands import (
    Part,
    check_most,
    count_pixels,
    count_totals,
    in_bands,
    offsets_from,
    over_pixels,
    parts_of,
    read_counts,
)
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.skips import frame_skips

NODE_BYTES = 12
"""Packed colour, depth and the next node."""

_END = 0xFFFFFFFF
_TURNS_A_LEVEL = 3
"""Of the sort's loops, for each fragment, at most."""

_PIXEL_BYTES = 4 + 4
"""n and the head of the list."""

# Storage bindings of abuffer-list/*.
_HEADS, _NODES, _USED, _COUNTS = range(4)


class ABufferList(Technique):
    """Per-pixel linked lists."""

    name = "abuffer-list"
    family = "exact"
    about = "a linked list a pixel"
    twin = Twin("exact")

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used: the pool holds all N fragments.

        Raises:
            Problem: One row of the window alone has more fragments than a storage buffer holds, or one pixel has more
                than a shader can go through.
        """
        clock = Clock(frame.ctx)
        counted = count_pixels(frame, clock)
        total, most = count_totals(frame, clock, counted.counts)
        check_most(most)

        def store(part: Part) -> list[moderngl.Buffer]:
            with clock.measure("list"):
                buffers = _lists(frame, part)
            with clock.measure("sort"):
                _sort(frame, part, counted.counts, most)
            return buffers

        parts = parts_of(frame, total, NODE_BYTES, lambda: offsets_from(frame, counted.counts))
        image = in_bands(frame, clock, counted.tiles, parts, store, "abuffer-list/resolve.frag")
        linear = read_linear(frame, image)
        return Rendered(
            linear=linear,
            k=read_counts(frame, counted.counts),
            passes={**frame.passes("opaque"), **clock.passes},
            captured=total,
            pool_bytes=NODE_BYTES * total,
            pixel_bytes=_PIXEL_BYTES,
            skips=frame_skips(frame, counted.tiles),
        )


def _lists(frame: Frame, part: Part) -> list[moderngl.Buffer]:
    """The lists of some rows, bound; nodes in the order of arrival, backwards."""
    heads, used = frame.buffer(part.rows * frame.width, _END), frame.buffer(1, 0)
    nodes = frame.ctx.buffer(reserve=NODE_BYTES * max(1, part.items))
    for binding, buffer in ((_HEADS, heads), (_NODES, nodes), (_USED, used)):
        buffer.bind_to_storage_buffer(binding)
    rows = (part.first, part.rows)
    frame.draw_transparent("abuffer-list/append.frag", frame.target([]), scissor=rows, first_row=part.first)
    frame.ctx.memory_barrier()
    return [heads, nodes]


def _sort(frame: Frame, part: Part, counts: moderngl.Buffer, most: int) -> None:
    """Sort the bound lists, of up to `most` fragments: a dispatch for as many levels as its loops may take turns."""
    counts.bind_to_storage_buffer(_COUNTS)
    levels = max(1, TURNS // (_TURNS_A_LEVEL * max(1, most)))
    run = 1
    while run < most:
        last = run << min(levels - 1, 30)
        over_pixels(
            frame,
            "abuffer-list/sort.comp",
            part.rows * frame.width,
            first_pixel=part.first * frame.width,
            first_run=run,
            last_run=min(last, 1 << 30),
        )
        run = 2 * last
