"""`kbuffer-deep`: whole bins of every pixel by a bundle's network, run as its own GLSL (METHOD.md 4).

Two geometry passes. The first gathers depth bins and the fragments in each; of those the network predicts from which
price on each bin is worth its fragments, and a price is selected that uses the budget (`renderer.allocation.gpu`). So
it is known how many of its bins are a pixel's core, and how many fragments they have: the second pass appends these and
blends the others into the tail. Then cores are sorted and resolved. Nothing is read back within a frame, and the
picture is the same to the bit whatever the order of the fragments, but for the rounding of the tail's sums.
"""

from __future__ import annotations

from pathlib import Path
from typing import Self

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer import timing
from renderer.allocation.cuts import events_of, solve_cuts
from renderer.allocation.gpu import DEFINES, FrameAllocation
from renderer.allocation.prices import gain_prices, importance_prices, prior_gains, ranks_of, shares_of
from renderer.bin_pass import Binned, word_defines
from renderer.csr import offsets_of
from renderer.features import TEXELS, reads_luma
from renderer.frame import Clock, Frame
from renderer.gpu_scene import run_for, set_uniforms
from renderer.onnx_network import OnnxNetwork
from renderer.programs import Defines
from renderer.screen import read_linear
from renderer.techniques.base import HYBRID, Budget, Inference, Needs, Rendered, Technique
from renderer.techniques.chain import SLOT_BYTES, Memory, TailInputs, resolve_slots, tail_targets
from renderer.techniques.skips import PREDICTOR, UNREAD_LUMA, frame_skips
from schemas.bundle import GLSL, ONNX, load_manifest
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.tail import TAILS

_GROUP = 64
_DISPATCH = 65535 * _GROUP
"""Pixels of one dispatch: the least maximum of work groups that GL promises."""

# Storage bindings of kbuffer-deep/*; those of prices.comp are the allocation's.
_PIXELS, _, _POOL, _, _RESULT = range(5)


class KBufferDeep(Technique):
    """The learned allocation.

    Args:
        bundle: Folder of a bundle; its hashes are verified.
        inference: `glsl`: the bundle's shader; `onnx`: onnxruntime on features that are read back, and cuts chosen in
            numpy, for machines whose "GPU" is the CPU, where a shader's matrix products do not use its vector units
            well. The cuts are the same but for what the network rounds.

    Raises:
        Problem: The bundle is damaged or not understood.
    """

    name = "kbuffer-deep"
    family = "bounded"
    about = "k(p) by a bundle's network"
    twin = HYBRID
    needs_bundle = True

    def __init__(self, bundle: Path, inference: Inference = "glsl") -> None:
        self.manifest = load_manifest(bundle)
        self._texts = {"bundle/predict.glsl": (bundle / GLSL).read_text(encoding="utf-8")}
        self._tail = TAILS[self.manifest.tail.name]
        self._luma = reads_luma(self.manifest.feature_names)
        self._defines: Defines = {
            **{"TEXELS": TEXELS, "OUTPUTS": len(self.manifest.outputs)},
            **word_defines(self._tail, self._luma),
            **DEFINES,
        }
        self._network = OnnxNetwork(bundle / ONNX) if inference == "onnx" else None
        self._memory: Memory | None = None  # of a technique that learns from what it resolves

    @classmethod
    def of(cls, needs: Needs) -> Self:
        """See `Technique.of`."""
        if needs.bundle is None:
            raise Problem(f"{cls.name} needs a bundle.", "Name the folder of one with --bundle.")
        return cls(needs.bundle, needs.inference)

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with predicted cuts; `sum k` is at most the budget, and less by at most one bin of one pixel.

        Raises:
            Problem: The budget asks for another tail than the bundle was made for, or the pool is too large.
        """
        if budget.tail != self.manifest.tail.name:
            raise Problem(
                f"{self.name} renders the tail its bundle was trained with, {self.manifest.tail.name}, "
                f"not {budget.tail}.",
                f"Leave out --tail, or train a bundle with `diaphane build --tail {budget.tail}`.",
                ExitCode.USAGE,
            )
        binned = frame.gather_bins(budget.tail, luma=self._luma)
        clock = Clock(frame.ctx)
        if self._network is None:
            allocation = FrameAllocation(frame.ctx, frame.gpu.programs, binned, frame.pixels, budget.fragments)
            self._place(frame, binned, allocation, clock)
        else:
            complete = self._place_on_cpu(frame, binned, budget.fragments, clock)
        image = self._draw(frame, clock, binned, budget)
        linear = read_linear(frame, image)
        # The frame is over: what follows are its statistics.
        if self._network is None:
            complete = allocation.read_state().complete
        k = binned.core_sizes()
        peak = binned.pixel_bytes + self._tail.sum_bytes
        free = SLOT_BYTES * binned.free_slots if _fits(binned, budget) else 0
        return Rendered(
            linear=linear,
            k=k,
            passes={**frame.passes("opaque", "range", "bins"), **clock.passes},
            captured=int(k.sum(dtype=np.int64)),
            pool_bytes=SLOT_BYTES * budget.fragments,
            pixel_bytes=peak - free,
            early_bytes=peak,
            skips={**frame_skips(frame), PREDICTOR: int(complete), UNREAD_LUMA: int(not self._luma)},
        )

    def _place(self, frame: Frame, binned: Binned, allocation: FrameAllocation, clock: Clock) -> None:
        """Predict ranks and choose cuts on the GPU."""
        with clock.measure("predict"):
            allocation.begin()
            self._predict_ranks(frame, binned, allocation)
        with clock.measure("allocate"):
            allocation.place()

    def _predict_ranks(self, frame: Frame, binned: Binned, allocation: FrameAllocation) -> None:
        """Run the network on the occupied pixels."""
        program = frame.gpu.programs.compute("kbuffer-deep/prices.comp", self._defines, self._texts)
        self._bind(frame, binned)
        set_uniforms(program, {"width": frame.width})
        allocation.run_pixels(program)

    def _place_on_cpu(self, frame: Frame, binned: Binned, fragments: int, clock: Clock) -> bool:
        """The same with the network in onnxruntime, and whether all that can be in a core is."""
        with clock.measure("predict"):
            with timing.readback(frame.ctx):
                counts = binned.counts()
            occupied = np.flatnonzero(counts.any(axis=1)).astype(np.uint32)
            ranks = self._ranks(frame, binned, occupied, counts[occupied])
        with clock.measure("allocate"):
            found = solve_cuts(events_of(ranks, counts[occupied]), fragments)
            cut, k = np.zeros(frame.pixels, dtype=np.uint32), np.zeros(frame.pixels, dtype=np.int64)
            cut[occupied], k[occupied] = found.cut, found.k
            binned.write_cores(cut, offsets_of(k)[:-1].astype(np.uint32))
        return found.rank is None

    def _ranks(
        self, frame: Frame, binned: Binned, pixels: NDArray[np.uint32], counts: NDArray[np.uint8]
    ) -> NDArray[np.uint8]:
        """Ranks of the bins of some pixels, which hold `counts`: what `prices.comp` does, in numpy."""
        answers = self._answers(frame, binned, pixels)
        if self.manifest.head == "importance":
            return ranks_of(importance_prices(answers[:, 0], counts), counts)
        with timing.readback(frame.ctx):
            kept = binned.kept()
        prior = prior_gains(*shares_of(kept[pixels], self._tail), counts, self._tail)
        return ranks_of(gain_prices(answers, prior), counts)

    def predict(self, frame: Frame, pixels: NDArray[np.uint32]) -> NDArray[np.float32]:
        """Run the network.

        Args:
            frame: The view.
            pixels: uint32 [M], indices of occupied pixels.

        Returns:
            float32 [M, outputs of the bundle]: `schemas.bundle.HEADS` says what they are.
        """
        return self._answers(frame, self._counted(frame), pixels)

    def features(self, frame: Frame, pixels: NDArray[np.uint32]) -> NDArray[np.float32]:
        """What the network reads of some pixels.

        Args:
            frame: The view.
            pixels: uint32 [M], indices of occupied pixels.

        Returns:
            float32 [M, features of the bundle], not normalised.
        """
        return self._dispatch(frame, self._counted(frame), pixels, len(self.manifest.features), features_only=True)

    def _counted(self, frame: Frame) -> Binned:
        return frame.gather_bins(self.manifest.tail.name, luma=self._luma)

    def _answers(self, frame: Frame, binned: Binned, pixels: NDArray[np.uint32]) -> NDArray[np.float32]:
        if self._network is None:
            return self._dispatch(frame, binned, pixels, len(self.manifest.outputs), features_only=False)
        columns = len(self.manifest.features)
        return self._network.run(self._dispatch(frame, binned, pixels, columns, features_only=True))

    def _dispatch(
        self, frame: Frame, binned: Binned, pixels: NDArray[np.uint32], columns: int, *, features_only: bool
    ) -> NDArray[np.float32]:
        """Run the compute shader on listed pixels, as many at once as a storage buffer has rows for."""
        out = np.empty((len(pixels), columns), dtype=np.float32)
        if len(pixels) == 0:
            return out
        defines = {**self._defines, "FEATURES_ONLY": int(features_only)}
        program = frame.gpu.programs.compute("kbuffer-deep/predict.comp", defines, self._texts)
        rows = min(len(pixels), _DISPATCH, LIMITS.buffer_bytes // (4 * columns))
        result, listed = frame.ctx.buffer(reserve=4 * columns * rows), frame.ctx.buffer(pixels)
        self._bind(frame, binned)
        for binding, buffer in ((_PIXELS, listed), (_RESULT, result)):
            buffer.bind_to_storage_buffer(binding)
        set_uniforms(program, {"width": frame.width, "pixels": len(pixels)})
        for first in range(0, len(pixels), rows):
            part = out[first : first + rows]
            set_uniforms(program, {"first": first})
            program.run(-(-len(part) // _GROUP))
            frame.ctx.memory_barrier(moderngl.BUFFER_UPDATE_BARRIER_BIT | moderngl.SHADER_STORAGE_BARRIER_BIT)
            with timing.readback(frame.ctx):
                result.read_into(part.reshape(-1).view(np.uint8), size=part.nbytes)
        return out

    @staticmethod
    def _bind(frame: Frame, binned: Binned) -> None:
        """Bind what `kbuffer-deep/inputs.glsl` reads."""
        binned.bind()
        frame.background.use(0)

    def _draw(self, frame: Frame, clock: Clock, binned: Binned, budget: Budget) -> moderngl.Texture:
        """Capture cores and tail, sort, resolve."""
        tail = TailInputs(self._tail, binned=binned)
        runs = {"RUNS": 1, "IN_WORDS": int(_fits(binned, budget))}
        with clock.measure("capture"):
            if not runs["IN_WORDS"]:
                pool = frame.buffer(SLOT_BYTES // 4 * budget.fragments, None)
                pool.bind_to_storage_buffer(_POOL)
            tails, defines = tail_targets(frame, tail), {**tail.defines, **runs}
            frame.draw_transparent("kbuffer-deep/capture.frag", frame.target(tails), defines, **tail.bind())
            frame.ctx.memory_barrier()
        with clock.measure("sort"):
            program = frame.gpu.programs.compute("kbuffer-deep/sort.comp", {**binned.defines, **runs})
            set_uniforms(program, {"pixels": frame.pixels})
            run_for(program, frame.pixels)
            frame.ctx.memory_barrier()
        with clock.measure("resolve"):
            return resolve_slots(frame, tail, tails, 2, self._memory, runs)


def _fits(binned: Binned, budget: Budget) -> bool:
    """Whether the pool lies in words that pixels no longer need."""
    return budget.fragments <= binned.pixels * binned.free_slots
