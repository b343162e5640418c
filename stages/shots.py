"""One technique on one view at one budget: rendered, checked against its CPU simulation, compared with the exact."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.pictures import EXACT, counts_map, quantise_map, stem, write_png
from labeller.curves import composite
from renderer import metrics
from renderer.dump import read_dump
from renderer.exr import write_exr
from renderer.exr_header import Attribute
from renderer.frame import Frame
from renderer.techniques import Budget, Rendered, SBuffer, Technique
from schemas.bundle import TailSpec
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.measurement import Measurement
from schemas.problem import ExitCode, Problem
from schemas.tail import TailName
from stages.desk import Desk
from stages.evaluate import EvaluateParams
from stages.tasks import Task

AGREEMENT = 1
"""Steps of 1/255 by which a GL picture may differ from the CPU simulation of its own allocation, in any channel."""

_WARM_SIZE = (64, 48)


class Session:
    """A view being evaluated: what its shots share, made when first needed.

    Args:
        desk: Artifacts and the scene on the GPU.
        task: The evaluation.
        params: Its parameters.
        trained: Tail of the bundle that is evaluated, which it renders whatever the task asks for; None: none is.
    """

    def __init__(self, desk: Desk, task: Task, params: EvaluateParams, trained: TailSpec | None = None) -> None:
        self.desk, self.task, self.params = desk, task, params
        self.tail: TailName = params.tail if trained is None else trained.name
        self.g: float = params.g if trained is None else trained.g

    @cached_property
    def frame(self) -> Frame:
        """The view on the GPU."""
        return self.desk.frame(self.task, self.params)

    @cached_property
    def dump(self) -> FragmentDump:
        """Its fragments."""
        return read_dump(self.desk.artifact(self.task, "render"))

    @cached_property
    def exact_linear(self) -> NDArray[np.float32]:
        """The reference picture, linear float32 [H, W, 3]: all fragments composited on the CPU in float64."""
        return self.simulate(self.dump.counts.astype(np.int32))

    @cached_property
    def exact(self) -> NDArray[np.uint8]:
        """The same as displayed, uint8 [H, W, 3]."""
        return display8(self.exact_linear)

    def simulate(self, k: NDArray[np.int32]) -> NDArray[np.float32]:
        """The CPU's picture of an allocation, linear float32 [H, W, 3].

        Args:
            k: int32 [P], core fragments of each pixel.
        """
        width, height = self.params.size
        return composite(self.dump, k, self.tail, self.g).reshape(height, width, 3)

    def render(self, technique: Technique, budget: Budget) -> Rendered:
        """A technique's picture; drivers compile shaders at their first use, so that is not the one measured."""
        compiled = self.desk.compiled(self.task, self.params)
        if technique.name not in compiled:
            compiled.add(technique.name)
            small = Frame(self.desk.gpu(self.task, self.params), self.params.view, *_WARM_SIZE)
            share = max(1, budget.fragments * small.pixels // self.frame.pixels)
            technique.render(small, Budget(share, budget.tail, budget.g))
        return technique.render(self.frame, budget)


@dataclass(frozen=True, slots=True)
class Shot:
    """A view and a budget, waiting for a technique.

    Attributes:
        session: The view.
        folder: Where pictures go.
        factor: F / (width * height).
        fragments: F.
    """

    session: Session
    folder: Path
    factor: float
    fragments: int

    def take(self, technique: Technique) -> Measurement:
        """Render, compare, keep the pictures."""
        if self.fragments >= self.session.dump.total:
            why = "the budget holds every fragment: every technique is exact"
            return self._record(technique.name, exact=True, skipped=why, mse=0.0)
        return self._take(technique, exact=False)

    def take_exact(self) -> Measurement:
        """Render with all fragments: what it costs is the memory it needs."""
        return self._take(SBuffer(), exact=True)

    def _take(self, technique: Technique, exact: bool) -> Measurement:
        try:
            rendered = self.session.render(technique, Budget(self.fragments, self.session.tail, self.session.g))
        except Problem as problem:
            if problem.code != ExitCode.LIMIT:
                raise
            # More fragments than a storage buffer holds: the others can still be measured.
            return self._record(technique.name, exact=exact, skipped=problem.title)
        return self._measure(technique.name, rendered, exact)

    def _measure(self, name: str, rendered: Rendered, exact: bool) -> Measurement:
        image, reference = display8(rendered.linear), self.session.exact
        difference = _largest_difference(image, display8(self.session.simulate(rendered.k)))
        self._require_agreement(name, difference)
        error = metrics.mse(image, reference)
        occupied = self.session.dump.counts > 0
        shape = (-1, 3)
        flip, error_map = metrics.flip(image, reference)
        self._keep(name, rendered, image, error_map)
        return self._record(
            name,
            exact=exact,
            mse=error,
            mse_occupied=metrics.mse(image.reshape(shape)[occupied], reference.reshape(shape)[occupied]),
            psnr=None if error == 0.0 else metrics.psnr(error),
            flip=flip,
            k_min=int(rendered.k[occupied].min()),
            k_max=int(rendered.k.max()),
            captured_fragments=rendered.captured,
            pool_bytes=rendered.pool_bytes,
            pixel_bytes=rendered.pixel_bytes,
            total_bytes=rendered.total_bytes,
            skips=dict(rendered.skips),
            passes=rendered.passes,
            total_ms=rendered.milliseconds,
            cpu_difference=difference,
        )

    def _keep(self, name: str, rendered: Rendered, image: NDArray[np.uint8], error_map: NDArray[np.float32]) -> None:
        base, exact = stem(name, self.factor), self.folder / EXACT
        about: dict[str, Attribute] = {"software": "diaphane", "tail": self.session.tail, "g": self.session.g}
        write_png(self.folder / f"{base}.png", image)
        write_exr(
            self.folder / f"{base}.exr", rendered.linear, {**about, "technique": name, "budget": str(self.fragments)}
        )
        write_png(self.folder / f"{base}.flip.png", quantise_map(error_map))
        write_png(self.folder / f"{base}.k.png", counts_map(rendered.k).reshape(image.shape[:2]))
        if not exact.exists():
            write_png(exact, self.session.exact)
            write_exr(exact.with_suffix(".exr"), self.session.exact_linear, {**about, "technique": "exact"})

    def _require_agreement(self, name: str, difference: int) -> None:
        if difference > AGREEMENT:
            raise Problem(
                f"The GL picture of {name} ({self.session.task.name}) differs from the CPU simulation of the same "
                f"allocation by {difference}/255.",
                "This is a defect of the driver or of Diaphane: please report it with the scene.",
                ExitCode.CHECK_FAILED,
            )

    def _record(self, name: str, **measured: Any) -> Measurement:
        """Without the scene's label, which is no part of the artifact: another run may call the scene otherwise."""
        params = self.session.params
        width, height = params.size
        return Measurement(
            scene="",
            view=params.view.name,
            technique=name,
            budget=self.fragments,
            budget_factor=self.factor,
            width=width,
            height=height,
            alpha=params.alpha,
            glass=params.glass,
            tail=self.session.tail,
            total_fragments=self.session.dump.total,
            **measured,
        )


def _largest_difference(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> int:
    return int(np.abs(a.astype(np.int16) - b.astype(np.int16)).max())
