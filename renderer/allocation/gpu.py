"""Slots of every pixel from predicted curves, by compute passes: nothing is read back within a frame.

`renderer.allocation.lattice` is the same in numpy, and says why it is exact. In order:

- `select`: totals of n in blocks, and whether all fits;
- a predictor fills in the curves of the occupied pixels, unless all fits;
- `solve`: a list of these pixels, then rounds of counting at 64 prices, those that are not needed being empty
  dispatches. The list is not there before: what the predictor reads is gone then, and the peak is lower by it;
- `place`: slots at the found price, the remainder, and their exclusive prefix sum.

Sums stop at 2^31 - 1: no budget is as large, and what stops there is the same in any order. A pixel takes part with at
most `renderer.screen.TURNS` fragments, so that a block's sums stay far below.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from renderer.allocation.lattice import EDGES, LAST, LEAST_RATE, MOST_FRAGMENTS, MOST_GAIN, MOST_RATE, ROUNDS, SHIFT
from renderer.gpu_scene import run_for, set_uniforms
from renderer.programs import Programs

BLOCK = 2048
"""Pixels of a work group."""
CEILING = 2**31 - 1
"""Where sums stop. A budget below it is met to the fragment; a pool of that many slots would be 17 GB."""
LIST_BYTES = 4
"""Bytes a pixel of the list that becomes the offsets; the blocks' sums are an eighth of a byte."""
CURVE_BYTES = 8
"""Bytes a pixel of the curves."""

STATE = np.dtype(
    [
        *((name, "<u4") for name in ("complete", "open_pixels", "budget", "low_sum")),
        *((name, "<u4") for name in ("listed", "rounds", "warm")),
        *((name, "<i4") for name in ("low", "high")),
        ("count_groups", "<u4", 3),
        ("edge", "<i4", EDGES),
    ]
)
"""`allocation/state.glsl`."""
assert STATE.fields is not None, "it is a structure"
_COUNT_GROUPS = int(STATE.fields["count_groups"][1])
"""Byte of `count_groups` in it."""

DEFINES = {"BLOCK": BLOCK, "EDGES": EDGES, "LAST": LAST, "SHIFT": SHIFT, "TURNS": MOST_FRAGMENTS}
CURVE_DEFINES = {**DEFINES, "MOST_GAIN": MOST_GAIN, "LEAST_RATE": LEAST_RATE, "MOST_RATE": MOST_RATE}
"""Of a shader that writes curves."""

_STATE, _COUNTS, _LIST, _CURVES, _BLOCKS = range(5)
"""Storage bindings of `allocation/*.comp`."""


@dataclass(frozen=True, slots=True)
class SolvedState:
    """What the passes of a frame found.

    Attributes:
        complete: Whether the budget covered every fragment, so that nothing was predicted or solved.
        rounds: Rounds that counted.
        index: Of the price (`renderer.allocation.lattice.price`).
    """

    complete: bool
    rounds: int
    index: int


class GpuAllocation:
    """Allocates one frame after the other; each search starts from the price of the last.

    Args:
        ctx: The context.
    """

    def __init__(self, ctx: moderngl.Context) -> None:
        self._ctx = ctx
        self._state = ctx.buffer(np.zeros(1, dtype=STATE))

    def select(self, programs: Programs, counts: moderngl.Buffer, pixels: int, budget: int) -> FrameAllocation:
        """Find what a frame has to solve.

        Args:
            programs: Of the context.
            counts: uint32 [P], n.
            pixels: P.
            budget: F.
        """
        allocation = FrameAllocation(self._ctx, programs, self._state, counts, pixels)
        allocation.select(budget)
        return allocation


class FrameAllocation:
    """The passes of one frame; made by `GpuAllocation.select`.

    Attributes:
        listed: uint32 [P+1]: the occupied pixels, in any order; `place` turns it into the offsets. Made by
            `solve`.
    """

    def __init__(
        self,
        ctx: moderngl.Context,
        programs: Programs,
        state: moderngl.Buffer,
        counts: moderngl.Buffer,
        pixels: int,
    ) -> None:
        self._ctx, self._programs, self._pixels = ctx, programs, pixels
        self._groups = pixels // BLOCK + 1  # blocks of pixels + 1 offsets
        self.listed: moderngl.Buffer | None = None
        scratch = ctx.buffer(reserve=4 * EDGES * self._groups)
        self._buffers = {_STATE: state, _COUNTS: counts, _BLOCKS: scratch}

    def select(self, budget: int) -> None:
        """Totals, and whether all fits."""
        self._run("totals", self._groups)
        self._run("begin", 1, blocks=self._groups, fragments=min(budget, CEILING - 1))

    def run_pixels(self, program: moderngl.ComputeShader, state_binding: int) -> None:
        """Run a shader on every pixel, as `run_for` does, with the state bound."""
        self._buffers[_STATE].bind_to_storage_buffer(state_binding)
        run_for(program, self._pixels)
        self._ctx.memory_barrier()

    def solve(self, curves: moderngl.Buffer) -> None:
        """Find the price of the listed pixels' curves; it stays in the state.

        Args:
            curves: float32 [P, 2], the a and rate of `renderer.allocation.lattice.Curves`, where n > 0.
        """
        self.listed = self._ctx.buffer(reserve=4 * (self._pixels + 1))
        self._buffers |= {_CURVES: curves, _LIST: self.listed}
        self._run("list", self._groups)
        for _ in range(ROUNDS):
            self._run("count", None)
            self._run("choose", 1)

    def forget_curves(self) -> None:
        """Let go of the curves: the slots are placed, and nothing else reads them."""
        self._buffers.pop(_CURVES, None)

    def place(self) -> moderngl.Buffer:
        """The offsets of every pixel's slots, uint32 [P+1]: slots at the price, and what is left by pixel index."""
        self._run("blocks", self._groups)
        self._run("scan", 1, blocks=self._groups)
        self._run("offsets", self._groups)
        assert self.listed is not None, "solve is before"
        return self.listed

    def read_state(self) -> SolvedState:
        """What was found, for statistics after a frame."""
        state = np.frombuffer(self._buffers[_STATE].read(), dtype=STATE)[0]
        return SolvedState(bool(state["complete"]), int(state["rounds"]), int(state["low"]))

    def _run(self, name: str, groups: int | None, **uniforms: int) -> None:
        """Run a shader, on as many groups as the state says a round needs where the number is None."""
        program = self._programs.compute(f"allocation/{name}.comp", DEFINES)
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
        set_uniforms(program, {"pixels": self._pixels, **uniforms})
        if groups is None:
            program.run_indirect(self._buffers[_STATE], _COUNT_GROUPS)
        else:
            program.run(groups)
        self._ctx.memory_barrier()
