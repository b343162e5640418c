"""Whole bins of every pixel from predicted curves, by compute passes: nothing is read back within a frame.

`renderer.allocation.cuts` is the same in numpy, and says why it is exact. In order:

- `begin`: fragments that can be in a core, and whether the budget covers them;
- a predictor fills in the curves of the occupied pixels, unless it does;
- `place`: two counts of fragments by price select the price that uses the budget, then cuts and their prefix sum.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from renderer.allocation.cuts import DROPPED_BITS, FULL, HALF_BITS, LEAST_FALL, MOST_CORE, MOST_FALL, MOST_GAIN
from renderer.bin_pass import Binned
from renderer.gpu_scene import run_for, set_uniforms
from renderer.programs import Defines, Programs

BLOCK = 2048
"""Pixels of a work group."""
CURVE_BYTES = 8
"""Bytes a pixel of the curves."""

STATE = np.dtype(
    [
        *((name, "<u4") for name in ("budget", "complete", "occupied", "fragments", "high", "rank", "spent")),
        ("counted", "<u4", 1 << HALF_BITS),
    ]
)
"""`allocation/state.glsl`."""

DEFINES: Defines = {
    **{"BLOCK": BLOCK, "HALF_BITS": HALF_BITS, "DROPPED_BITS": DROPPED_BITS, "FULL": FULL, "MOST_CORE": MOST_CORE},
    **{"MOST_GAIN": MOST_GAIN, "LEAST_FALL": LEAST_FALL, "MOST_FALL": MOST_FALL},
}
"""Of the shaders of an allocation, and of those that write curves, beside BINS."""

_STATE, _COUNTS, _CURVES, _BLOCKS, _OFFSETS = range(5)
"""Storage bindings of `allocation/*.comp`."""


@dataclass(frozen=True, slots=True)
class AllocationState:
    """What the passes of a frame found.

    Attributes:
        complete: Whether the budget covered all that can be in a core: nothing was predicted or selected.
        occupied: Pixels with fragments.
        rank: Of the price that all pixels were granted (`renderer.allocation.cuts`), as `Cuts` has it.
    """

    complete: bool
    occupied: int
    rank: int | None


class FrameAllocation:
    """The passes of one frame.

    Args:
        ctx: The context.
        programs: Of the context.
        binned: The frame's bins, counted. Their counts become cuts and cursors.
        pixels: P.
        budget: F.
    """

    def __init__(self, ctx: moderngl.Context, programs: Programs, binned: Binned, pixels: int, budget: int) -> None:
        assert binned.counts is not None, "bins are counted"
        self._ctx, self._programs, self._pixels = ctx, programs, pixels
        self._defines = {**DEFINES, "BINS": binned.tail.bins}
        self._blocks = -(-pixels // BLOCK)
        state = np.zeros(1, dtype=STATE)
        state["budget"] = min(budget, 2**32 - 1)
        self._buffers = {
            _STATE: ctx.buffer(state),
            _COUNTS: binned.counts,
            _BLOCKS: ctx.buffer(reserve=8 * self._blocks),
        }

    def begin(self) -> None:
        """Find whether the budget covers all that can be in a core."""
        self._run("totals", self._blocks)
        self._run("choose", 1, STEP=0)

    def run_pixels(self, program: moderngl.ComputeShader) -> None:
        """Run a shader on every pixel, as `run_for` does, with state and counts bound where these passes have them."""
        for binding in (_STATE, _COUNTS):
            self._buffers[binding].bind_to_storage_buffer(binding)
        set_uniforms(program, {"pixels": self._pixels})
        run_for(program, self._pixels)
        self._ctx.memory_barrier()

    def place(self, curves: moderngl.Buffer) -> moderngl.Buffer:
        """Select the price, and lay out the pool: counts become cuts and cursors.

        Args:
            curves: float32 [P, 2], a and b of the occupied pixels.

        Returns:
            uint32 [P], where each pixel's run of the pool begins.
        """
        offsets = self._ctx.buffer(reserve=4 * self._pixels)
        self._buffers |= {_CURVES: curves, _OFFSETS: offsets}
        for low in (0, 1):
            self._run("count", self._blocks, LOW=low)
            self._run("choose", 1, STEP=1 + low)
        self._run("blocks", self._blocks)
        self._run("scan", 1)
        self._run("place", self._blocks)
        self._buffers.pop(_CURVES)  # nothing else reads them
        return offsets

    def read_state(self) -> AllocationState:
        """What was found, for statistics after a frame."""
        state = np.frombuffer(self._buffers[_STATE].read(), dtype=STATE)[0]
        complete = bool(state["complete"])
        return AllocationState(complete, int(state["occupied"]), None if complete else int(state["rank"]) - 1)

    def _run(self, name: str, groups: int, **defines: int) -> None:
        program = self._programs.compute(f"allocation/{name}.comp", {**self._defines, **defines})
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
        set_uniforms(program, {"pixels": self._pixels, "blocks": self._blocks})
        program.run(groups)
        self._ctx.memory_barrier()
