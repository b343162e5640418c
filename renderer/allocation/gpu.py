"""Whole bins of every pixel from predicted prices, by compute passes: nothing is read back within a frame.

`renderer.allocation.cuts` is the same in numpy, and says why it is exact. In order:

- `begin`: fragments that can be in a core, and whether the budget covers them;
- a predictor fills in the ranks of the occupied pixels, unless it does;
- `place`: a count of fragments by rank selects the rank that uses the budget, then cuts and their prefix sum.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from renderer.allocation.cuts import FULL, MOST_CORE
from renderer.allocation.prices import (
    LEAST_ALONE,
    LEAST_COVERED,
    LEAST_IMPORTANCE,
    LEAST_PRICE,
    LEAST_PRIOR,
    MOST_ALONE,
    PRICE_STEPS,
    RANKS,
)
from renderer.bin_pass import Binned
from renderer.gpu_scene import run_for, set_uniforms
from renderer.programs import Defines, Programs

BLOCK = 2048
"""Pixels of a work group."""

STATE = np.dtype(
    [
        *((name, "<u4") for name in ("budget", "complete", "occupied", "fragments", "rank", "spent")),
        ("counted", "<u4", RANKS),
    ]
)
"""`allocation/state.glsl`."""

DEFINES: Defines = {
    **{"BLOCK": BLOCK, "RANKS": RANKS, "FULL": FULL, "MOST_CORE": MOST_CORE},
    **{"LEAST_PRICE": LEAST_PRICE, "PRICE_STEPS": PRICE_STEPS, "LEAST_PRIOR": LEAST_PRIOR},
    **{"LEAST_COVERED": LEAST_COVERED, "LEAST_ALONE": LEAST_ALONE, "MOST_ALONE": MOST_ALONE},
    **{"LEAST_IMPORTANCE": LEAST_IMPORTANCE},
}
"""Of the shaders of an allocation, and of those that write ranks, beside those of a tail."""

_STATE, _BLOCKS = 0, 3
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
        binned: The frame's packed bins.
        pixels: P.
        budget: F.
    """

    def __init__(self, ctx: moderngl.Context, programs: Programs, binned: Binned, pixels: int, budget: int) -> None:
        self._ctx, self._programs, self._binned, self._pixels = ctx, programs, binned, pixels
        self._defines = {**DEFINES, **binned.defines}
        self._blocks = -(-pixels // BLOCK)
        state = np.zeros(1, dtype=STATE)
        state["budget"] = min(budget, 2**32 - 1)
        self._buffers = {
            _STATE: ctx.buffer(state),
            _BLOCKS: ctx.buffer(reserve=8 * self._blocks),
        }

    def begin(self) -> None:
        """Find whether the budget covers all that can be in a core."""
        self._run("totals", self._blocks)
        self._run("complete", 1)

    def run_pixels(self, program: moderngl.ComputeShader) -> None:
        """Run a shader on every pixel, as `run_for` does, with state and bins bound where these passes have them."""
        self._buffers[_STATE].bind_to_storage_buffer(_STATE)
        self._binned.bind()
        set_uniforms(program, {"pixels": self._pixels})
        run_for(program, self._pixels)
        self._ctx.memory_barrier()

    def place(self) -> None:
        """Select the rank, and lay out the pool: a pixel's counts and ranks become its core."""
        self._run("count", self._blocks)
        self._run("choose", 1)
        self._run("blocks", self._blocks)
        self._run("scan", 1)
        self._run("place", self._blocks)

    def read_state(self) -> AllocationState:
        """What was found, for statistics after a frame."""
        state = np.frombuffer(self._buffers[_STATE].read(), dtype=STATE)[0]
        complete = bool(state["complete"])
        return AllocationState(complete, int(state["occupied"]), None if complete else int(state["rank"]) - 1)

    def _run(self, name: str, groups: int) -> None:
        program = self._programs.compute(f"allocation/{name}.comp", self._defines)
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
        self._binned.bind()
        set_uniforms(program, {"pixels": self._pixels, "blocks": self._blocks})
        program.run(groups)
        self._ctx.memory_barrier()
