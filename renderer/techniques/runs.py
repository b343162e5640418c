"""Every transparent fragment in contiguous runs, one a pixel, in a pool of exactly the right size, on the GPU.

Count, prefix sum, capture. The counts become the offsets in place, and the offsets the capture's cursors, which stop
where the runs end: one word a pixel. Two words are read back before the picture, the fragments of the frame and of its
fullest pixel, since a pool needs a size; and the ends of the rows where one storage buffer cannot hold the pool.
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.frame import Clock, Frame
from renderer.gpu_scene import set_uniforms
from renderer.prefix import prefix_sums
from renderer.techniques.bands import Part, count_pixels, over_pixels, parts_of, read_counts

LONG = 257
"""Runs of so many fragments or more are sorted by a work group each."""
PIXEL_BYTES = 4
"""The ends of the runs. Tiles and the blocks of the prefix sum take a fiftieth of a byte."""

# Storage bindings of runs/*.
_ENDS, _POOL, _LIST = range(3)


class Runs:
    """The runs of a frame.

    Args:
        frame: The view.
        clock: Gets the passes `count`, `prefix`, `capture` and `sort`.
        words: Of a fragment: 2 for packed colour and depth, 3 with the rank (`shaders/runs/runs.glsl`).

    Attributes:
        tiles: By their fullest pixel.
        ends: uint32 [P+1]: where each pixel's run begins; where it ends once its rows are captured.
        total: N.
        most: Fragments of the fullest pixel.
    """

    def __init__(self, frame: Frame, clock: Clock, words: int) -> None:
        counted = count_pixels(frame, clock)
        with clock.measure("prefix"):
            self.ends, sums = prefix_sums(
                frame.ctx, frame.gpu.programs, counted.counts, frame.pixels, into=counted.counts
            )
            self.total, self.most = sums.read()
        self.tiles = counted.tiles
        self._frame, self._clock, self._words = frame, clock, words

    @property
    def pool_bytes(self) -> int:
        """Bytes of the runs of the whole window."""
        return 4 * self._words * self.total

    def parts(self) -> list[Part]:
        """Bands of rows whose runs fit a storage buffer; asked for before any is captured.

        Raises:
            Problem: One row alone does not fit.
        """
        return parts_of(self._frame, self.total, 4 * self._words, lambda: self.ends)

    def capture(self, part: Part) -> moderngl.Buffer:
        """The runs of some rows, bound, in any order inside: uint32 [items, words], at least one."""
        frame = self._frame
        with self._clock.measure("capture"):
            pool = frame.ctx.buffer(reserve=4 * self._words * max(1, part.items))
            self.ends.bind_to_storage_buffer(_ENDS)
            pool.bind_to_storage_buffer(_POOL)
            frame.draw_transparent(
                "runs/capture.frag",
                frame.target([]),
                {"WORDS": self._words},
                scissor=(part.first, part.rows),
                ranked=self._words > 2,
                base=part.base,
            )
            frame.ctx.memory_barrier()
        return pool

    def sort_long(self, part: Part) -> None:
        """Sort the bound runs of at least `LONG` fragments: they are listed on the GPU, then a group sorts each."""
        if self.most < LONG:
            return
        with self._clock.measure("sort"):
            listed = self._frame.ctx.buffer(reserve=4 * (3 + part.items // LONG + 1))
            listed.write(np.array([0, 1, 1], dtype=np.uint32))
            listed.bind_to_storage_buffer(_LIST)
            self._over_pixels("runs/list.comp", part)
            program = self._frame.gpu.programs.compute("runs/sort_long.comp", self._defines)
            set_uniforms(program, {"base": part.base})
            program.run_indirect(listed)
            self._frame.ctx.memory_barrier()

    def sort(self, part: Part) -> None:
        """Sort all bound runs in place."""
        with self._clock.measure("sort"):
            self._over_pixels("runs/sort.comp", part)
        self.sort_long(part)

    def read_counts(self) -> NDArray[np.int32]:
        """int32 [P], n(p), once all is captured: a statistic, for after a frame."""
        return np.diff(read_counts(self._frame, self.ends), prepend=np.int32(0))

    @property
    def _defines(self) -> dict[str, int]:
        return {"WORDS": self._words, "LONG": LONG}

    def _over_pixels(self, shader: str, part: Part) -> None:
        first, pixels = self._frame.width * part.first, self._frame.width * part.rows
        over_pixels(self._frame, shader, pixels, self._defines, base=part.base, first_pixel=first)
