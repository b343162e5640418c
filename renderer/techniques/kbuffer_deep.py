"""`kbuffer-deep`: k(p) from a bundle's network, run as its own GLSL on sums gathered in the frame (METHOD.md 4)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.allocation.fill import feasible_k_min, solve_lambda
from renderer.features import texels_of
from renderer.frame import ALL_TEXELS, Clock, Frame
from renderer.gpu_scene import set_uniforms
from renderer.onnx_network import OnnxNetwork
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import render_chain, render_complete
from renderer.techniques.skips import SETTLED_PIXELS, UNREAD_SUMS
from schemas.bundle import GLSL, ONNX, load_manifest
from schemas.limits import LIMITS

Inference = Literal["glsl", "onnx"]

_GROUP = 64
_DISPATCH = 65535 * _GROUP
"""Pixels of one dispatch: the least maximum of work groups that GL promises."""

# Storage bindings of kbuffer-deep/predict.comp; its textures are bound in the order of its declarations.
_PIXELS, _Z_MIN, _Z_MAX, _NEAREST, _RESULT = range(5)


class KBufferDeep:
    """The learned allocation.

    Args:
        bundle: Folder of a bundle; its hashes are verified.
        inference: `glsl`: the bundle's shader; `onnx`: onnxruntime on features that are read back, for machines whose
            "GPU" is the CPU, where a shader's matrix products do not use its vector units well.

    Raises:
        Problem: The bundle is damaged or not understood.
    """

    name = "kbuffer-deep"

    def __init__(self, bundle: Path, inference: Inference = "glsl") -> None:
        self.manifest = load_manifest(bundle)
        self._texts = {"bundle/predict.glsl": (bundle / GLSL).read_text(encoding="utf-8")}
        self._texels = texels_of(self.manifest.feature_names)
        self._network = OnnxNetwork(bundle / ONNX) if inference == "onnx" else None

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with predicted slots; the budget is met exactly where it is below N."""
        n = frame.count()
        complete = render_complete(frame, n, budget)
        if complete is not None:
            return complete
        gathered = frame.gather("gather", self._texels)
        clock = Clock(frame.ctx)
        slots, settled = self._allocate(frame, n, budget.fragments, clock)
        rendered = render_chain(frame, slots, n, budget, gathered)
        unread = len(ALL_TEXELS - self._texels - {0})  # n is always gathered
        skips = {**rendered.skips, SETTLED_PIXELS: settled, UNREAD_SUMS: unread}
        return replace(rendered, passes={**rendered.passes, **clock.passes}, skips=skips)

    def _allocate(
        self, frame: Frame, n: NDArray[np.uint32], fragments: int, clock: Clock
    ) -> tuple[NDArray[np.int32], int]:
        """Slots of every pixel, and how many occupied pixels needed no network."""
        k_min = feasible_k_min(n, fragments)
        slots = np.minimum(n, k_min).astype(np.int32)
        with clock.measure("select"):
            open_pixels = np.flatnonzero(n > k_min).astype(np.uint32)
        settled = int(np.count_nonzero(n)) - len(open_pixels)
        if len(open_pixels) == 0:
            return slots, settled
        with clock.measure("predict"):
            gain = self.predict(frame, open_pixels)
        with clock.measure("lambda"):
            left = fragments - int(slots.sum(dtype=np.int64)) + k_min * len(open_pixels)
            chosen, _ = solve_lambda(gain[:, 0], gain[:, 1], n[open_pixels], left, k_min)
            slots[open_pixels] = chosen
        return slots, settled

    def predict(self, frame: Frame, pixels: NDArray[np.uint32]) -> NDArray[np.float32]:
        """Run the network.

        Args:
            frame: The view.
            pixels: uint32 [M], pixel indices.

        Returns:
            float32 [M, 2]: a and b of `log gain(k) = a - b (k - 1)`.
        """
        if self._network is not None:
            return self._network.run(self.features(frame, pixels))
        return self._dispatch(frame, pixels, 2, features_only=False)

    def features(self, frame: Frame, pixels: NDArray[np.uint32]) -> NDArray[np.float32]:
        """What the network reads of some pixels.

        Args:
            frame: The view.
            pixels: uint32 [M], pixel indices.

        Returns:
            float32 [M, features of the bundle], not normalised.
        """
        return self._dispatch(frame, pixels, len(self.manifest.features), features_only=True)

    def _dispatch(
        self, frame: Frame, pixels: NDArray[np.uint32], columns: int, *, features_only: bool
    ) -> NDArray[np.float32]:
        """Run the compute shader on all pixels, as many at once as a storage buffer has rows for."""
        gathered = frame.gather("gather", self._texels)
        _, z_min, z_max = frame.depth_range()
        defines = {"FEATURES_ONLY": int(features_only)}
        program = frame.gpu.programs.compute("kbuffer-deep/predict.comp", defines, self._texts)
        rows = min(len(pixels), _DISPATCH, LIMITS.buffer_bytes // (4 * columns))
        result, listed = frame.ctx.buffer(reserve=4 * columns * rows), frame.ctx.buffer(pixels)
        nearest = gathered.nearest_colour or z_min  # a bundle that does not read it gets any buffer
        buffers = {_PIXELS: listed, _Z_MIN: z_min, _Z_MAX: z_max, _NEAREST: nearest, _RESULT: result}
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)
        for unit, texture in enumerate([*gathered.sums, frame.background]):
            texture.use(unit)
        set_uniforms(program, {"width": frame.width, "pixels": len(pixels)})
        out = np.empty((len(pixels), columns), dtype=np.float32)
        for first in range(0, len(pixels), rows):
            part = out[first : first + rows]
            set_uniforms(program, {"first": first})
            program.run(-(-len(part) // _GROUP))
            frame.ctx.memory_barrier(moderngl.BUFFER_UPDATE_BARRIER_BIT | moderngl.SHADER_STORAGE_BARRIER_BIT)
            result.read_into(part.reshape(-1).view(np.uint8), size=part.nbytes)
        return out
