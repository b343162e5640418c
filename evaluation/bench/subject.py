"""A view under test: its fragments, the exact picture, and the offline allocations that scores divide by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evaluation.bench.cells import steepness
from evaluation.bench.exact import Exact
from labeller.allocation import Allocation
from labeller.curves import Curves, composite, error_curves
from labeller.rules import allocate_curves
from renderer import metrics
from renderer.capture import capture
from renderer.frame import RGB, Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, Rendered
from schemas.bench import Yardstick
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.tail import TailName
from schemas.view import View

ORACLE_TAIL: TailName = "weighted-average"
"""Of DHOIT's Algorithm 1, with the opacity factor that the paper leaves out (METHOD.md section 2)."""


@dataclass(frozen=True, slots=True)
class Errors:
    """What a picture is off by; see `schemas.bench.BenchCell`."""

    mse: float
    mse_display: float
    mse_linear: float
    mse_occupied: float
    psnr: float | None
    ssim: float
    flip: float


class Subject:
    """A view of a scene on the GPU. What needs all fragments is made once, when it is first asked for.

    Args:
        gpu: The scene.
        view: The camera.
        size: Width and height.
        background: Linear RGB where nothing is.
    """

    def __init__(self, gpu: GpuScene, view: View, size: tuple[int, int], background: RGB = (1.0, 1.0, 1.0)) -> None:
        self.gpu, self.view, self.size, self.background = gpu, view, size, background
        self._curves: dict[tuple[TailName, float], Curves] = {}
        self._allocations: dict[tuple[TailName, float, int, str], Allocation] = {}

    @property
    def pixels(self) -> int:
        """P."""
        return self.size[0] * self.size[1]

    def frame(self) -> Frame:
        """The view anew: nothing that another technique left there is reused."""
        return Frame(self.gpu, self.view, *self.size, self.background)

    @cached_property
    def dump(self) -> FragmentDump:
        """All transparent fragments."""
        return capture(self.frame()).dump

    @cached_property
    def reference(self) -> Exact:
        """The exact picture."""
        return Exact(self.dump)

    @property
    def exact(self) -> NDArray[np.float32]:
        """The exact picture, float32 [P, 3], linear RGB."""
        return self.reference.linear

    @property
    def exact8(self) -> NDArray[np.uint8]:
        """The same as displayed, uint8 [H, W, 3]."""
        return self.reference.image

    def curves(self, tail: TailName, g: float) -> Curves:
        """Error curves of all pixels with a tail, as displayed."""
        if (tail, g) not in self._curves:
            self._curves[tail, g] = error_curves(self.dump, tail, g, "display")
        return self._curves[tail, g]

    def allocation(
        self, rule: Literal["greedy", "optimal"], tail: TailName, g: float, budgets: Sequence[int]
    ) -> list[Allocation]:
        """Allocations of some budgets, each made once."""
        missing = [f for f in dict.fromkeys(budgets) if (tail, g, f, rule) not in self._allocations]
        if missing:
            made = allocate_curves(self.dump, self.curves(tail, g), missing, rule)
            self._allocations.update({(tail, g, found.budget, rule): found for found in made})
        return [self._allocations[tail, g, f, rule] for f in budgets]

    def allocate(self, frame: Frame, budget: Budget) -> NDArray[np.int32]:
        """What `kbuffer-optimal` renders: the certified optimum with its tail."""
        return self.allocation("optimal", budget.tail, budget.g, [budget.fragments])[0].k

    def yardsticks(
        self, rule: Literal["greedy", "optimal"], tail: TailName, g: float, factors: Sequence[float]
    ) -> list[Yardstick]:
        """The error of offline allocations, composited on the CPU with their tail.

        Args:
            rule: Which allocation.
            tail: Of curves and picture.
            g: Steepness of the density tail.
            factors: Budgets as multiples of the pixels.
        """
        occupied = self.dump.counts > 0
        made = []
        for factor, found in zip(factors, self.allocation(rule, tail, g, self.budgets(factors)), strict=True):
            linear = composite(self.dump, found.k, tail, g)
            k = found.k[occupied]
            made.append(
                Yardstick(
                    rule=rule,
                    tail=tail,
                    g=steepness(tail, g),
                    budget_factor=factor,
                    budget=found.budget,
                    mse=metrics.mse(display8(linear), self.exact8.reshape(-1, 3)),
                    mse_display=self.reference.display_error(linear),
                    gap=found.gap,
                    k_min=int(k.min(initial=np.iinfo(np.int32).max)) if len(k) else 0,
                    k_max=int(k.max(initial=0)),
                    captured_fragments=found.used,
                )
            )
        return made

    def budgets(self, factors: Sequence[float]) -> list[int]:
        """F of each factor, at least 1."""
        return [max(1, int(factor * self.pixels)) for factor in factors]

    def errors(self, rendered: Rendered) -> Errors:
        """What a picture of this view is off by."""
        linear = rendered.linear.reshape(-1, 3)
        image = display8(rendered.linear)
        occupied = self.dump.counts > 0
        error = metrics.mse(image, self.exact8)
        return Errors(
            mse=error,
            mse_display=self.reference.display_error(linear),
            mse_linear=float(np.mean(np.square(linear - self.exact, dtype=np.float64))),
            mse_occupied=_mse(image.reshape(-1, 3)[occupied], self.exact8.reshape(-1, 3)[occupied]),
            psnr=None if error == 0.0 else metrics.psnr(error),
            ssim=metrics.ssim(image, self.exact8),
            flip=metrics.flip(image, self.exact8)[0],
        )


def _mse(test: NDArray[np.uint8], reference: NDArray[np.uint8]) -> float:
    return metrics.mse(test, reference) if len(test) else 0.0
