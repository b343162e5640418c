"""`kbuffer-deep`: k(p) from a bundle's network, run as its own GLSL on sums gathered in the frame (METHOD.md 4).

Nothing is read back within a frame: the network's curves stay on the GPU, where the one lambda is found that uses the
budget (`renderer.allocation.gpu`), and the pool has as many slots as the budget allows. Importances are turned into
curves (`renderer.allocation.lattice.importance_curves`). What the network has read is given back before fragments are
captured, and so are its curves, unless another budget of the same frame is to need no inference.
"""

from __future__ import annotations

import re
import weakref
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer import timing
from renderer.allocation.fill import budget_fill, solve_lambda
from renderer.allocation.gpu import CURVE_BYTES, CURVE_DEFINES, LIST_BYTES, FrameAllocation, GpuAllocation
from renderer.allocation.lattice import within_limits
from renderer.features import TEXELS, texels_of
from renderer.frame import ALL_TEXELS, BIN_DEFINES, Clock, Frame, Gathered, front_bytes
from renderer.gpu_scene import set_uniforms
from renderer.onnx_network import OnnxNetwork
from renderer.programs import Defines
from renderer.screen import read_linear
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import (
    RANGE_BYTES,
    SLOT_BYTES,
    Memory,
    chain_bytes,
    draw_chain,
    gathered_for_tail,
    render_chain,
    render_complete,
)
from renderer.techniques.skips import PREDICTOR, TAIL, UNREAD_SUMS, frame_skips
from schemas.bundle import GLSL, ONNX, load_manifest
from schemas.limits import LIMITS
from schemas.tail import DENSITY_BINS

Inference = Literal["glsl", "onnx"]
Solver = Literal["gpu", "cpu"]

_GROUP = 64
FIRST_SUM_BYTES = 16
"""Of the sums that a tail without bins may read, and that stay."""
_DISPATCH = 65535 * _GROUP
"""Pixels of one dispatch: the least maximum of work groups that GL promises."""

# Storage bindings of kbuffer-deep/*.comp; their textures are bound in the order of their declarations.
_PIXELS, _Z_MIN, _Z_MAX, _NEAREST, _RESULT = range(5)
_COUNTS, _FRONT = 6, 7
_STATE, _CURVES = 0, 5


@dataclass(frozen=True, slots=True)
class _Prediction:
    """What the network answered in a frame, kept for its other budgets."""

    frame: weakref.ref[Frame]
    gathered: Gathered
    curves: moderngl.Buffer
    passes: dict[str, float]
    before_bytes: int


def before_bytes(gathered: Gathered) -> int:
    """Bytes a pixel at most until fragments are captured: gathering, running the network, or choosing slots."""
    kept = front_bytes(gathered.bins) or FIRST_SUM_BYTES
    predicting, choosing = gathered.pixel_bytes + CURVE_BYTES, kept + CURVE_BYTES + LIST_BYTES
    return RANGE_BYTES + max(gathered.pass_bytes, predicting, choosing)


class KBufferDeep:
    """The learned allocation.

    Args:
        bundle: Folder of a bundle; its hashes are verified.
        inference: `glsl`: the bundle's shader; `onnx`: onnxruntime on features that are read back, for machines whose
            "GPU" is the CPU, where a shader's matrix products do not use its vector units well.
        solver: Where the slots are chosen: `gpu` in compute passes, `cpu` in numpy with two readbacks; None: where the
            network runs. The counts are the same but for ties and roundings.
        keeps_curves: Whether what the network answers on the GPU stays there while fragments are captured: eight bytes
            a pixel, with which another budget of the same frame needs no inference.

    Raises:
        Problem: The bundle is damaged or not understood.
        ValueError: The GPU is to solve what onnxruntime predicts.
    """

    name = "kbuffer-deep"

    def __init__(
        self,
        bundle: Path,
        inference: Inference = "glsl",
        solver: Solver | None = None,
        *,
        keeps_curves: bool = False,
    ) -> None:
        self.manifest = load_manifest(bundle)
        if solver == "gpu" and inference == "onnx":
            raise ValueError("the GPU solves what GLSL predicts")
        self._texts = {"bundle/predict.glsl": (bundle / GLSL).read_text(encoding="utf-8")}
        self._bins = DENSITY_BINS.get(self.manifest.tail.name, 0)
        self._texels = texels_of(self.manifest.feature_names, binned=bool(self._bins))
        self._unread = len(ALL_TEXELS - self._texels - (frozenset() if self._bins else {0}))  # what is not gathered
        # Bundles of format 1 were written when there were fewer sums.
        texels = re.search(r"in vec4 s\[(\d+)\]", self._texts["bundle/predict.glsl"])
        self._defines: Defines = {
            **{"TEXELS": TEXELS if texels is None else int(texels[1]), "BINS": self._bins},
            "OUTPUTS": len(self.manifest.outputs),
            **(BIN_DEFINES if self._bins else {}),
        }
        self._network = OnnxNetwork(bundle / ONNX) if inference == "onnx" else None
        self._solver = solver or ("gpu" if inference == "glsl" else "cpu")
        self._keeps_curves = keeps_curves
        self._allocation: GpuAllocation | None = None
        self._prediction: _Prediction | None = None
        self._memory: Memory | None = None  # of a technique that learns from what it resolves

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with predicted slots; the budget is met exactly where it is below N."""
        # A pool larger than a buffer may be is bounded by N, which has to be read for that.
        if self._solver == "cpu" or frame.counted or 4 * budget.fragments > LIMITS.buffer_bytes:
            complete = render_complete(frame, frame.count(), budget)
            if complete is not None:
                return complete
        return self._render_on_cpu(frame, budget) if self._solver == "cpu" else self._render_on_gpu(frame, budget)

    def _render_on_gpu(self, frame: Frame, budget: Budget) -> Rendered:
        counts, _, _ = frame.depth_range()
        if self._allocation is None:
            self._allocation = GpuAllocation(frame.ctx)
        kept = self._prediction if self._prediction and self._prediction.frame() is frame else None
        gathered = frame.gather("gather", self._texels, self._bins) if kept is None else kept.gathered
        before = before_bytes(gathered) if kept is None else kept.before_bytes
        clock = Clock(frame.ctx)
        with clock.measure("select"):
            allocation = self._allocation.select(frame.gpu.programs, counts, frame.pixels, budget.fragments)
        if kept is None:
            with clock.measure("predict"):
                curves = self._curves(frame, gathered, allocation)
            gathered = frame.retire(gathered)
        else:
            curves = kept.curves
            clock.passes |= kept.passes
        with clock.measure("lambda"):
            allocation.solve(curves)
        with clock.measure("prefix"):
            offsets = allocation.place()
        if not self._keeps_curves:
            allocation.forget_curves()
            del curves
        for_tail = gathered_for_tail(frame, budget, gathered)
        read = [] if for_tail is None or for_tail.name == "gather" else [for_tail.name]
        image = draw_chain(
            frame, clock, offsets, budget.fragments, budget, for_tail, complete=False, memory=self._memory
        )
        linear = read_linear(frame, image)
        # The frame is over: what follows are its statistics.
        state = allocation.read_state()
        k = np.diff(np.frombuffer(offsets.read(), dtype=np.uint32).astype(np.int64)).astype(np.int32)
        if kept is None and self._keeps_curves and not state.complete:
            predicted = {"predict": clock.passes["predict"]}
            self._prediction = _Prediction(weakref.ref(frame), gathered, curves, predicted, before)
        pool_bytes = SLOT_BYTES * budget.fragments
        during = chain_bytes(for_tail, budget.tail) + (CURVE_BYTES if self._keeps_curves else 0)
        during += 0 if for_tail is gathered else gathered.pixel_bytes  # beside what another tail than its own reads
        skips = {PREDICTOR: int(state.complete), TAIL: 0}
        return Rendered(
            linear=linear,
            k=k,
            passes={**frame.passes("opaque", "count", "gather", *read), **clock.passes},
            captured=int(k.sum(dtype=np.int64)),
            pool_bytes=pool_bytes,
            pixel_bytes=during,
            early_bytes=before,
            skips={**frame_skips(frame), **skips, UNREAD_SUMS: self._unread},
        )

    def _curves(self, frame: Frame, gathered: Gathered, allocation: FrameAllocation) -> moderngl.Buffer:
        """Run the network on the pixels with fragments."""
        program = frame.gpu.programs.compute(
            "kbuffer-deep/curves.comp", {**CURVE_DEFINES, **self._defines}, self._texts
        )
        curves = frame.buffer(CURVE_BYTES // 4 * frame.pixels, None)
        self._bind(frame, gathered)
        curves.bind_to_storage_buffer(_CURVES)
        set_uniforms(program, {"width": frame.width, "pixels": frame.pixels})
        allocation.run_pixels(program, _STATE)
        return curves

    def _render_on_cpu(self, frame: Frame, budget: Budget) -> Rendered:
        n = frame.count()
        gathered = frame.gather("gather", self._texels, self._bins)
        clock = Clock(frame.ctx)
        slots = self._allocate(frame, n, budget.fragments, clock)
        # What is read back of every occupied pixel, and the list of them.
        columns = len(self.manifest.outputs if self._network is None else self.manifest.features)
        answers = 4 * (1 + columns) * int(np.count_nonzero(n))
        before = RANGE_BYTES + gathered.pixel_bytes - (-answers // frame.pixels)
        rendered = render_chain(frame, slots, n, budget, gathered, before)
        skips = {**rendered.skips, UNREAD_SUMS: self._unread}
        shared = frame.passes("opaque", "count", "gather")
        return replace(rendered, passes={**shared, **clock.passes, **rendered.passes}, skips=skips)

    def _allocate(self, frame: Frame, n: NDArray[np.uint32], fragments: int, clock: Clock) -> NDArray[np.int32]:
        """Slots of every pixel."""
        slots = np.zeros(len(n), dtype=np.int32)
        with clock.measure("select"):
            occupied = np.flatnonzero(n).astype(np.uint32)
        with clock.measure("predict"):
            answers = self.predict(frame, occupied)
        with clock.measure("lambda"):
            if self.manifest.head == "importance":  # NaN, of a network that overflows, is no importance
                slots[occupied] = budget_fill(np.nan_to_num(answers[:, 0]), n[occupied], fragments)
            else:
                a, b = within_limits(answers[:, 0], answers[:, 1])
                slots[occupied], _ = solve_lambda(a, b, n[occupied], fragments)
        return slots

    def predict(self, frame: Frame, pixels: NDArray[np.uint32]) -> NDArray[np.float32]:
        """Run the network.

        Args:
            frame: The view.
            pixels: uint32 [M], pixel indices.

        Returns:
            float32 [M, outputs of the bundle]: `schemas.bundle.HEADS` says what they are.
        """
        if self._network is not None:
            return self._network.run(self.features(frame, pixels))
        return self._dispatch(frame, pixels, len(self.manifest.outputs), features_only=False)

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
        gathered = frame.gather("gather", self._texels, self._bins)
        defines = {**self._defines, "FEATURES_ONLY": int(features_only)}
        program = frame.gpu.programs.compute("kbuffer-deep/predict.comp", defines, self._texts)
        rows = min(len(pixels), _DISPATCH, LIMITS.buffer_bytes // (4 * columns))
        result, listed = frame.ctx.buffer(reserve=4 * columns * rows), frame.ctx.buffer(pixels)
        self._bind(frame, gathered)
        listed.bind_to_storage_buffer(_PIXELS)
        result.bind_to_storage_buffer(_RESULT)
        set_uniforms(program, {"width": frame.width, "pixels": len(pixels)})
        out = np.empty((len(pixels), columns), dtype=np.float32)
        for first in range(0, len(pixels), rows):
            part = out[first : first + rows]
            set_uniforms(program, {"first": first})
            program.run(-(-len(part) // _GROUP))
            frame.ctx.memory_barrier(moderngl.BUFFER_UPDATE_BARRIER_BIT | moderngl.SHADER_STORAGE_BARRIER_BIT)
            with timing.readback(frame.ctx):
                result.read_into(part.reshape(-1).view(np.uint8), size=part.nbytes)
        return out

    @staticmethod
    def _bind(frame: Frame, gathered: Gathered) -> None:
        """Bind what `kbuffer-deep/inputs.glsl` reads."""
        counts, z_min, z_max = frame.depth_range()
        nearest = gathered.nearest_colour or z_min  # a bundle that does not read it gets any buffer
        for binding, buffer in ((_COUNTS, counts), (_Z_MIN, z_min), (_Z_MAX, z_max), (_NEAREST, nearest)):
            buffer.bind_to_storage_buffer(binding)
        if gathered.front is not None:
            gathered.front.bind_to_storage_buffer(_FRONT)
        for unit, texture in enumerate([*gathered.sums, frame.background]):
            texture.use(unit)
