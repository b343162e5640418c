"""`sbuffer`: exact. Every fragment in contiguous per-pixel runs, sorted, composited (Vasilakis and Fudos 2012).

Count, prefix sum, capture into a pool of exactly the right size, sort, resolve. `renderer.capture` makes the same runs
in one geometry pass, but with 12 bytes a fragment and a list whose length it has to guess.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer import timing
from renderer.bands import row_bands
from renderer.csr import offsets_of, sort_fragments
from renderer.frame import Clock, Frame
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import SLOT_BYTES, resolve_all
from renderer.techniques.skips import frame_skips
from schemas.limits import LIMITS


class SBuffer:
    """The exact picture."""

    name = "sbuffer"

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used: the pool holds all N fragments."""
        n = frame.count()
        clock = Clock(frame.ctx)
        with clock.measure("prefix"):
            offsets = offsets_of(n)
            keys = np.empty(int(offsets[-1]), dtype=np.uint64)
            bands = row_bands(offsets, frame.width, LIMITS.buffer_bytes // SLOT_BYTES)
        with clock.measure("capture"):
            for first, rows in bands:
                capture_band(frame, "sbuffer/capture.frag", offsets, (first, rows), keys)
        with clock.measure("sort"):
            sort_fragments(offsets, keys)
            colours = (keys & np.uint64(0xFFFFFFFF)).astype(np.uint32)
        with clock.measure("resolve"):
            image = resolve_all(frame, offsets, colours)
        return Rendered(
            linear=image,
            k=n.astype(np.int32),
            passes={**frame.passes("opaque", "count"), **clock.passes},
            captured=len(keys),
            pool_bytes=SLOT_BYTES * len(keys),
            pixel_bytes=12 + 4,
            skips=frame_skips(frame),
        )


def capture_band(
    frame: Frame,
    fragment: str,
    offsets: NDArray[np.int64],
    band: tuple[int, int],
    into: NDArray[np.integer],
    ranked: bool = False,
) -> None:
    """Capture a band of rows into the runs of its pixels.

    Args:
        frame: The view.
        fragment: Shader with a cursor at binding 0, the pool at binding 1, and `first_row`.
        offsets: int64 [P+1].
        band: First row and number of rows, with at least one fragment.
        into: [N, ...], C-contiguous; gets the band's part, in any order inside a pixel.
        ranked: As `GpuScene.draw` has it.
    """
    first, rows = band
    begin, end = first * frame.width, (first + rows) * frame.width
    base, stop = int(offsets[begin]), int(offsets[end])
    cursor = frame.ctx.buffer((offsets[begin:end] - base).astype(np.uint32))
    pool = frame.ctx.buffer(reserve=into.strides[0] * (stop - base))
    cursor.bind_to_storage_buffer(0)
    pool.bind_to_storage_buffer(1)
    frame.draw_transparent(fragment, frame.target([]), scissor=band, ranked=ranked, first_row=first)
    frame.ctx.memory_barrier()
    with timing.readback(frame.ctx):
        pool.read_into(into[base:stop])
    cursor.release()
    pool.release()
