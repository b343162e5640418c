"""The numbers of a scene: fragments counted at the size asked for, errors measured on small pictures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluation.advice.rules import affordable, candidates
from evaluation.bench.cells import Bundle
from evaluation.bench.subject import Subject
from labeller.budgets import default_budgets
from renderer import metrics
from renderer.account.ledger import count_frame
from renderer.exact_bytes import exact_bytes
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import TECHNIQUES, Budget, Needs, Rendered, Technique, technique
from renderer.techniques.chain import SLOT_BYTES
from schemas.advice import AdvisedScene, Candidate, Sample, SeenView, Size, Work
from schemas.colour import display8
from schemas.problem import ExitCode, Problem
from schemas.tail import DEFAULT_TAIL
from schemas.view import View
from schemas.work import total_work

MEASURED_PIXELS: Final = 384 * 216
"""Errors are means over pixels: so many are enough to rank techniques, and a scene is advised in seconds."""
COUNTED_PIXELS: Final = 1920 * 1080
"""Counting is one pass over the geometry; fragments per pixel do not depend on the size beyond this."""
LEFT_OUT: Final = ("kbuffer-temporal", "kbuffer-optimal")
"""The first is `kbuffer-deep` on a still view; no renderer can have the second."""


def within(size: Size, pixels: int) -> Size:
    """The size, made smaller if it has more pixels; its aspect stays."""
    factor = min(1.0, (pixels / size.pixels) ** 0.5)
    return Size(width=max(16, round(size.width * factor)), height=max(16, round(size.height * factor)))


@dataclass(slots=True)
class Measuring:
    """A scene being measured.

    Args:
        name: How it is called.
        gpu: The scene.
        views: Few views.
        size: That is asked for.
        memory: Bytes that it may take: the budgets that they buy are measured too.
        bundle: For the techniques that run one.
    """

    name: str
    gpu: GpuScene
    views: Sequence[View]
    size: Size
    memory: int
    bundle: Bundle | None
    _left_out: dict[str, None] = field(default_factory=dict)

    @property
    def measured(self) -> Size:
        """Size of the pictures whose errors are measured."""
        return within(self.size, MEASURED_PIXELS)

    def scene(self) -> AdvisedScene:
        """All that is known of the scene."""
        counted = within(self.size, COUNTED_PIXELS)
        counts = {view.name: self._counts(view, counted) for view in self.views}
        seen = [
            SeenView(name=name, load=int(n.sum(dtype=np.int64)) / counted.pixels, most=int(n.max(initial=0)))
            for name, n in counts.items()
        ]
        loads = {view.name: view.load for view in seen if view.load}
        samples: list[Sample] = []
        for view in self.views:
            if view.name in loads:
                samples += _exact(view.name, counts[view.name])
                samples += self._samples(self.subject(view), default_budgets(loads.values()), max(loads.values()))
        return AdvisedScene(
            name=self.name,
            views=tuple(seen),
            counted=counted,
            measured=self.measured,
            candidates=candidates(samples, list(loads)),
            left_out=tuple(self._left_out),
        )

    def subject(self, view: View) -> Subject:
        """A view at the size of the pictures whose errors are measured."""
        return Subject(self.gpu, view, (self.measured.width, self.measured.height))

    def rendered(self, subject: Subject, one: Candidate) -> Rendered:
        """The picture of a candidate, of any family."""
        return self._technique(one.technique).render(subject.frame(), self._budget(one.technique, one.budget))

    def work(self, view: View, one: Candidate) -> Work:
        """What a frame of a candidate does."""
        subject = self.subject(view)
        total = total_work(count_frame(self.gpu, lambda: self.rendered(subject, one)).values())
        pixels = subject.pixels
        return Work(
            technique=one.technique,
            geometry_passes=total.geometry_passes,
            shaded=total.shaded / pixels,
            moved_bytes=total.moved_bytes / pixels,
            atomics=total.atomics / pixels,
        )

    def _counts(self, view: View, size: Size) -> NDArray[np.integer]:
        return Frame(self.gpu, view, size.width, size.height, (1.0, 1.0, 1.0)).count()

    def _samples(self, subject: Subject, budgets: Sequence[float], load: float) -> Iterator[Sample]:
        for name, entry in TECHNIQUES.items():
            if entry.family == "exact" or name in LEFT_OUT:
                continue
            if entry.needs_bundle and self.bundle is None:
                self._left_out[f"{name} needs a bundle: give one with --bundle."] = None
                continue
            try:
                yield from self._of_technique(name, subject, budgets, load)
            except Problem as problem:
                if problem.code != ExitCode.LIMIT:
                    raise
                self._left_out[f"{name}: {problem.title}"] = None

    def _of_technique(self, name: str, subject: Subject, budgets: Sequence[float], load: float) -> Iterator[Sample]:
        made, family = self._technique(name), TECHNIQUES[name].family
        for budget in budgets if family == "bounded" else (None,):
            rendered = made.render(subject.frame(), self._budget(name, budget))
            yield self._sample(name, budget, subject, rendered)
        if family == "bounded":
            early, beside = float(rendered.early_bytes), float(rendered.pixel_bytes)
            buys = affordable(self.memory, self.size.pixels, beside, early, SLOT_BYTES)
            # A budget of all fragments is an S-buffer with more beside it.
            if 0.0 < buys < load and buys not in budgets:
                rendered = made.render(subject.frame(), self._budget(name, buys))
                yield self._sample(name, buys, subject, rendered)

    def _sample(self, name: str, budget: float | None, subject: Subject, rendered: Rendered) -> Sample:
        entry = TECHNIQUES[name]
        return Sample(
            view=subject.view.name,
            technique=name,
            family=entry.family,
            budget=budget,
            tail=self._budget(name, budget).tail if entry.family == "bounded" else "",
            bundle=self.bundle.label if entry.needs_bundle and self.bundle is not None else "",
            pixel_bytes=rendered.compared_bytes / subject.pixels,
            mse=metrics.mse(display8(rendered.linear), subject.exact8),
        )

    def _technique(self, name: str) -> Technique:
        return technique(name, Needs(bundle=None if self.bundle is None else self.bundle.folder))

    def _budget(self, name: str, budget: float | None) -> Budget:
        fragments = max(1, int((2.0 if budget is None else budget) * self.measured.pixels))
        if self.bundle is None:
            return Budget(fragments, DEFAULT_TAIL)
        return Budget(fragments, self.bundle.tail.name, self.bundle.tail.g)


def _exact(view: str, n: NDArray[np.integer]) -> Iterator[Sample]:
    """What the exact techniques take, from counts alone."""
    for name, entry in TECHNIQUES.items():
        found = exact_bytes(name, n)
        if found is not None:
            yield Sample(
                view=view, technique=name, family=entry.family, pixel_bytes=found.total / found.pixels, mse=0.0
            )
