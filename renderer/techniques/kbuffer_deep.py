"""`kbuffer-deep`: k(p) from a bundle's network, run as its own GLSL on sums gathered in the frame (METHOD.md 4)."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.allocation.fill import feasible_k_min, solve_lambda
from renderer.frame import Clock, Frame
from renderer.gpu_scene import set_uniforms
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import render_chain
from schemas.bundle import GLSL, load_manifest

_GROUP = 64
_DISPATCH = 65535 * _GROUP
"""Pixels of one dispatch: the least maximum of work groups that GL promises."""

# Storage bindings of kbuffer-deep/predict.comp; its textures are bound in the order of its declarations.
_PIXELS, _Z_MIN, _Z_MAX, _NEAREST, _GAIN = range(5)


class KBufferDeep:
    """The learned allocation.

    Args:
        bundle: Folder of a bundle; its hashes are verified.

    Raises:
        Problem: The bundle is damaged or not understood.
    """

    name = "kbuffer-deep"

    def __init__(self, bundle: Path) -> None:
        self.manifest = load_manifest(bundle)
        self._glsl = (bundle / GLSL).read_text(encoding="utf-8")

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with predicted slots; the budget is met exactly where it is below N."""
        n = frame.count()
        frame.gather("gather")
        clock = Clock(frame.ctx)
        slots = self._allocate(frame, n, budget.fragments, clock)
        rendered = render_chain(frame, slots, n, budget, gathered="gather")
        rendered.passes.update(clock.passes)
        return rendered

    def _allocate(self, frame: Frame, n: NDArray[np.uint32], fragments: int, clock: Clock) -> NDArray[np.int32]:
        k_min = feasible_k_min(n, fragments)
        slots = np.minimum(n, k_min).astype(np.int32)
        # Pixels that k_min covers are settled: no network for them.
        with clock.measure("select"):
            open_pixels = np.flatnonzero(n > k_min).astype(np.uint32)
        if len(open_pixels) == 0:
            return slots
        with clock.measure("predict"):
            gain = self.predict(frame, open_pixels)
        with clock.measure("lambda"):
            left = fragments - int(slots.sum(dtype=np.int64)) + k_min * len(open_pixels)
            chosen, _ = solve_lambda(gain[:, 0], gain[:, 1], n[open_pixels], left, k_min)
            slots[open_pixels] = chosen
        return slots

    def predict(self, frame: Frame, pixels: NDArray[np.uint32]) -> NDArray[np.float32]:
        """Run the network.

        Args:
            frame: The view, fully gathered.
            pixels: uint32 [M], pixel indices.

        Returns:
            float32 [M, 2]: a and b of `log gain(k) = a - b (k - 1)`.
        """
        gathered = frame.gather("gather")
        assert gathered.nearest_colour is not None, "a full gather has the nearest fragment"
        _, z_min, z_max = frame.depth_range()
        program = frame.gpu.programs.compute("kbuffer-deep/predict.comp", {"bundle/predict.glsl": self._glsl})
        gain = frame.ctx.buffer(reserve=8 * len(pixels))
        listed = frame.ctx.buffer(pixels)
        buffers = {_PIXELS: listed, _Z_MIN: z_min, _Z_MAX: z_max, _NEAREST: gathered.nearest_colour, _GAIN: gain}
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)
        for unit, texture in enumerate([*gathered.sums, frame.background]):
            texture.use(unit)
        set_uniforms(program, {"width": frame.width, "pixels": len(pixels)})
        for first in range(0, len(pixels), _DISPATCH):
            set_uniforms(program, {"first": first})
            program.run(-(-min(len(pixels) - first, _DISPATCH) // _GROUP))
        frame.ctx.memory_barrier(moderngl.BUFFER_UPDATE_BARRIER_BIT | moderngl.SHADER_STORAGE_BARRIER_BIT)
        return np.frombuffer(gain.read(), dtype=np.float32).reshape(-1, 2)
