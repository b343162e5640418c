"""`kbuffer-temporal`: `kbuffer-deep` that learns from its last frame (METHOD.md 4).

A resolved pixel knows what each fragment of its last core bin gained: the squared change of its displayed colour when
that bin is in the core instead of the tail, shared by them. In the next frame, the prices of all its bins are moved by
what that was above or below the price of that bin, before the budget is spent, which is met as ever. Each pixel
remembers in one word the sum of its moves, what was seen, and n.

- A move is a share of what the price was wrong by: half of it at first, a third in the next frame, and so on. With a
  constant share, pixels jump to and fro between two cuts for ever; so they settle, and a still camera's picture stands
  still once its pixels have learnt from `FRAMES` frames each; one without a core sees nothing in a frame.
- While the camera moves, a pixel's memory stays at its place in the window. It is forgotten where n is another by more
  than an eighth, and shares do not become smaller than a ninth. Moving memories with the nearest fragments was tried
  on one scene, and was no better.
- All begins anew with another scene, size, budget or bundle, and after a cut: the camera has turned or moved far, or
  has another lens.

The same frames give the same pictures, to the bit where the tail's sums are (`renderer.techniques.chain`).
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import moderngl
import numpy as np

from renderer.allocation.gpu import DEFINES as ALLOCATION_DEFINES
from renderer.allocation.gpu import FrameAllocation
from renderer.allocation.prices import PRICE_STEPS
from renderer.bin_pass import Binned
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene, set_uniforms
from renderer.programs import Defines
from renderer.techniques.base import Budget, Inference, Rendered
from renderer.techniques.chain import Memory
from renderer.techniques.kbuffer_deep import KBufferDeep
from renderer.techniques.skips import PREDICTOR
from schemas.problem import ExitCode, Problem
from schemas.view import View

SETTLED: Final = 9
"""Frames of a still camera after which the error hardly falls (docs/TECHNIQUES.md)."""
SEEN_STEPS: Final = 8
"""Steps of a seen log gain in a unit."""
SEEN_LEAST: Final = -28
"""Log gains below this are taken for it: a change of the colour by 1e-6, the rounding of float32."""
MOST_WRONG: Final = 3.0
"""Most of what a price is wrong by that one frame is believed."""
FRAMES: Final = 15
"""Frames that correct a pixel of a still camera."""
MOVING_FRAMES: Final = 7
"""Frames that a pixel counts at most while the camera moves."""
CUT_DEGREES: Final = 6.0
"""A camera that turns by more than this from one frame to the next has not moved there."""
CUT_SHARE: Final = 0.05
"""Nor has one whose eye is farther away than this share of the diagonal of the scene's bounds."""
MEMORY_BYTES: Final = 4
"""Bytes a pixel, from frame to frame."""

DEFINES: Final[Defines] = {
    **{"SEEN_STEPS": SEEN_STEPS, "SEEN_LEAST": SEEN_LEAST, "FRAMES": FRAMES},
    **{"MOVING_FRAMES": MOVING_FRAMES, "MOST_WRONG": MOST_WRONG, "PRICE_STEPS": PRICE_STEPS},
}
"""Of `kbuffer-temporal/*`."""

_MEMORY = 6
"""Storage binding of kbuffer-temporal/correct.comp beside the allocation's."""


@dataclass(frozen=True, slots=True)
class _Past:
    """What the memory was made for: with anything else it begins anew."""

    gpu: weakref.ref[GpuScene]
    size: tuple[int, int]
    budget: Budget
    view: View
    memory: moderngl.Buffer

    def serves(self, frame: Frame, budget: Budget) -> bool:
        """Whether a frame may go on with it."""
        if (self.gpu(), self.size, self.budget) != (frame.gpu, (frame.width, frame.height), budget):
            return False
        low, high = frame.gpu.scene.bounds
        return not is_cut(self.view, frame.view, float(np.linalg.norm(high - low)))


def is_cut(before: View, after: View, extent: float) -> bool:
    """Whether a camera is elsewhere rather than moved.

    Args:
        before: Of the last frame.
        after: Of this one.
        extent: Metres across the scene.
    """
    lenses = ((view.fov, view.ortho_height, view.shift) for view in (before, after))
    if next(lenses) != next(lenses):
        return True
    # The trace of a rotation is 1 + 2 cos(angle).
    turn = np.trace(before.world_to_view()[:3, :3] @ after.world_to_view()[:3, :3].T)
    moved = np.linalg.norm(np.subtract(before.eye, after.eye))
    return bool(turn < 1.0 + 2.0 * np.cos(np.radians(CUT_DEGREES)) or moved > CUT_SHARE * extent)


class KBufferTemporal(KBufferDeep):
    """The learned allocation, corrected from frame to frame.

    Args:
        bundle: Folder of a bundle; its hashes are verified.
        inference: As `KBufferDeep` has it; only prices that GLSL predicts can be corrected.

    Raises:
        Problem: The bundle is damaged or not understood.
    """

    name = "kbuffer-temporal"
    about = "k(p) by a network and the last frame"
    settles = SETTLED

    def __init__(self, bundle: Path, inference: Inference = "glsl") -> None:
        super().__init__(bundle, inference)
        self._past: _Past | None = None
        self._still = False

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render the next frame; the first one is that of `kbuffer-deep`.

        Raises:
            Problem: There are no prices on the GPU.
        """
        if self._network is not None or self.manifest.head != "bin-gains":
            raise Problem(
                f"{self.name} corrects prices of bins on the GPU, which this bundle or --inference does not leave.",
                "Use kbuffer-deep, or a bundle of the head bin-gains and --inference glsl.",
                ExitCode.LIMIT,
            )
        past, self._past = self._past, None
        if past is None or not past.serves(frame, budget):
            memory = frame.buffer(MEMORY_BYTES // 4 * frame.pixels, 0)
            past = _Past(weakref.ref(frame.gpu), (frame.width, frame.height), budget, frame.view, memory)
        self._still = past.view == frame.view.model_copy(update={"name": past.view.name})
        self._memory = Memory(past.memory, DEFINES)
        rendered = super().render(frame, budget)
        # A frame that failed, or has slots for all, has noted nothing: the memory would be that of an earlier one.
        if not rendered.skips.get(PREDICTOR):
            self._past = replace(past, view=frame.view)
        return replace(
            rendered,
            pixel_bytes=rendered.pixel_bytes + MEMORY_BYTES,
            early_bytes=rendered.early_bytes + MEMORY_BYTES,
        )

    def _predict_ranks(self, frame: Frame, binned: Binned, allocation: FrameAllocation) -> None:
        """What the network predicts, corrected by what was seen of the last frame."""
        super()._predict_ranks(frame, binned, allocation)
        assert self._memory is not None, "render is before"
        defines = {**ALLOCATION_DEFINES, **DEFINES, **binned.defines}
        program = frame.gpu.programs.compute("kbuffer-temporal/correct.comp", defines)
        self._memory.buffer.bind_to_storage_buffer(_MEMORY)
        set_uniforms(program, {"still": int(self._still)})
        allocation.run_pixels(program)
