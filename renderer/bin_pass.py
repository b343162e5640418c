"""The pass that fills a binned tail's depth bins, and what lies in their place afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.gpu_scene import run_for, set_uniforms
from renderer.programs import Defines
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.tail import TAILS, Tail, TailName

if TYPE_CHECKING:
    from renderer.frame import Frame

BINS, RANGE = 5, 7
"""Storage bindings of a pixel's words and of tile ranges, in every shader."""
CORE_WORDS: Final = 2
"""Of a pixel's core, behind those of what is kept: where its run begins, its cut and cursor."""
CURSOR_BITS: Final = 27
"""Of a core's second word; the bits above are its cut."""


@dataclass(frozen=True, slots=True)
class Binned:
    """A pixel's words (`shaders/common/bin_words.glsl`), in one buffer.

    Attributes:
        name: Name of the tail.
        tail: Its row.
        words: uint32 [P, words of a pixel], packed.
        pixels: P.
        ranges: uint32 [T, 2], between which depths the bins of a tile's pixels lie, float bits.
        luma: Whether sums of luma are gathered too: one word more.
    """

    name: TailName
    tail: Tail
    words: moderngl.Buffer
    pixels: int
    ranges: moderngl.Buffer
    luma: bool = False

    @property
    def pixel_words(self) -> int:
        """Words of a pixel."""
        return self.tail.bins + self.luma

    @property
    def pixel_bytes(self) -> int:
        """Bytes of a pixel; ranges are an eighth of one more."""
        return 4 * self.pixel_words

    @property
    def defines(self) -> Defines:
        """Of a shader that reads them."""
        return word_defines(self.tail, self.luma)

    @property
    def free_slots(self) -> int:
        """Slots of a pool that fit into what a pixel no longer needs once it has a core."""
        return (self.pixel_words - self.tail.bins // 2 - CORE_WORDS) // 2

    def bind(self) -> None:
        """Bind the words and the tile ranges."""
        self.words.bind_to_storage_buffer(BINS)
        self.ranges.bind_to_storage_buffer(RANGE)

    def read(self) -> NDArray[np.uint32]:
        """uint32 [P, words of a pixel], read back."""
        return np.frombuffer(self.words.read(), dtype=np.uint32).reshape(self.pixels, -1)

    def write_cores(self, cut: NDArray[np.uint32], begin: NDArray[np.uint32]) -> None:
        """Give every pixel its core: uint32 [P] each, bins in it and where its run of the pool begins.

        Args:
            cut: uint32 [P], bins in each pixel's core.
            begin: uint32 [P], first slot of each pixel's run of the pool.
        """
        words, first = self.read().copy(), self.tail.bins // 2
        words[:, first], words[:, first + 1] = begin, cut << np.uint32(CURSOR_BITS) | begin
        self.words.write(words)

    def kept(self) -> NDArray[np.uint16]:
        """uint16 [P, BINS], what is kept of the bins (`shaders/common/kept_bins.glsl`), read back."""
        return np.ascontiguousarray(self.read()[:, : self.tail.bins // 2]).view(np.uint16)

    def counts(self) -> NDArray[np.uint8]:
        """uint8 [P, BINS], fragments of each packed bin, `COUNT_LIMIT` for that many or more, read back."""
        first = self.tail.bins // 2
        return np.ascontiguousarray(self.read()[:, first : first + self.tail.bins // 4]).view(np.uint8)

    def core_sizes(self) -> NDArray[np.int32]:
        """int32 [P], fragments of each pixel's core, read back once all is captured."""
        begin, core = self.read()[:, self.tail.bins // 2 :][:, :CORE_WORDS].T
        ends = (core & (1 << CURSOR_BITS) - 1).astype(np.int64)
        return np.asarray(ends - begin, dtype=np.int32)


def word_defines(tail: Tail, luma: bool) -> Defines:
    """Of a shader that reads a pixel's words."""
    return {**tail.defines, "LUMA": int(luma), "PIXEL_WORDS": tail.bins + luma}


def gather_bins(frame: Frame, name: TailName, *, luma: bool = False) -> Binned:
    """Fill the depth bins of every pixel, and pack them in their place.

    Args:
        frame: The view.
        name: A tail with bins.
        luma: Whether sums of luma are gathered too.

    Raises:
        Problem: The words are more than a storage buffer may hold.
    """
    tail = TAILS[name]
    size = 4 * frame.pixels * (tail.bins + luma)
    if size > LIMITS.words_bytes:
        raise Problem(
            f"The depth bins of {frame.pixels:,} pixels need {size / 2**20:.0f} MiB, "
            f"above the limit of {LIMITS.words_bytes / 2**20:.0f} MiB.",
            "Ask for a smaller picture or a tail of fewer bins.",
            ExitCode.LIMIT,
        )
    words = frame.ctx.buffer(reserve=size)
    words.clear()
    binned = Binned(name, tail, words, frame.pixels, frame.tile_range(), luma)
    binned.bind()
    frame.draw_transparent("gather/bins.frag", frame.target([]), binned.defines)
    frame.ctx.memory_barrier()
    program = frame.gpu.programs.compute("gather/pack.comp", binned.defines)
    set_uniforms(program, {"pixels": frame.pixels})
    run_for(program, frame.pixels)
    frame.ctx.memory_barrier()
    return binned
