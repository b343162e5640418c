"""One scene measured: the times of all techniques in turns, their errors, bytes and work."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.graphics.checking import why
from evaluation.bench.measure import needed
from evaluation.bench.rounds import Run, in_turns
from evaluation.bench.subject import Subject
from renderer import metrics
from renderer.techniques import TECHNIQUES, Budget, Needs, Rendered, technique
from schemas.bench import BenchCell, CellKey
from schemas.colour import display8
from schemas.problem import Problem
from schemas.tail import TailName
from schemas.work import PassWork

REFERENCES = ("sbuffer", "abuffer-list")
"""Techniques whose picture is the exact one: the first that can render a view."""
_MOST_SECONDS = 4.0
"""Of the repeats of one cell."""


@dataclass(slots=True)
class Measuring:
    """A view being measured.

    Args:
        subject: The view.
        needs: What techniques need.
        tail: Of the bounded techniques.
        budgets: F / WH.
        repeats: Timed frames of each cell.
        deadline: On the clock of `time.monotonic`; what is left then is left out.

    Attributes:
        n: Transparent fragments of each pixel, int [P].
        late: Cells that were not measured for want of time, in words.
    """

    subject: Subject
    needs: Needs
    tail: TailName
    budgets: Sequence[float]
    repeats: int
    deadline: float
    late: list[str] = field(default_factory=list)
    n: NDArray[np.uint32] = field(init=False)
    _exact: NDArray[np.uint8] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        self.n = self.subject.frame().count()
        for name in REFERENCES:
            try:
                rendered = technique(name).render(self.subject.frame(), Budget(0))
            except (Problem, moderngl.Error) as reason:
                why(reason)
                continue
            self._exact = display8(rendered.linear)
            return

    def cells(self, names: Sequence[str], counts_work: bool) -> list[BenchCell]:
        """Measured cells, in the order of the techniques.

        Args:
            names: Of the techniques.
            counts_work: Whether a frame of each is counted, if there is time.
        """
        found: dict[CellKey, BenchCell] = {}
        runs: list[Run] = []
        for run in [run for name in names for run in self._runs(name)]:
            if time.monotonic() > self.deadline:
                self.late.append(said(run.key))
                continue
            cell = self._pictured(run)
            found[run.key] = cell
            if cell.problem is None:
                runs.append(run)
        share = (self.deadline - time.monotonic()) / max(len(runs), 1)
        in_turns(self.subject, runs, self.repeats, min(_MOST_SECONDS, max(share, 1e-3)))
        for run in runs:
            update: dict[str, Any] = {"passes": run.passes(), "gpu": run.gpu(), "frame": run.frame()}
            if counts_work and time.monotonic() < self.deadline:
                update["work"] = self._work(run)
            found[run.key] = found[run.key].model_copy(update={**update, "repeats": len(run.recordings)})
        return list(found.values())

    def _runs(self, name: str) -> list[Run]:
        if TECHNIQUES[name].family != "bounded":
            return [Run(CellKey(technique=name, basis="none"), technique(name, self.needs), Budget(0))]
        made = []
        for factor in self.budgets:
            key = CellKey(technique=name, basis="fragments", budget_factor=factor, tail=self.tail)
            budget = Budget(max(1, int(factor * self.subject.pixels)), self.tail)
            made.append(Run(key, technique(name, self.needs), budget))
        return made

    def _pictured(self, run: Run) -> BenchCell:
        about: dict[str, Any] = {**run.key.model_dump(), "family": TECHNIQUES[run.key.technique].family}
        if run.key.basis != "none":
            about["budget"] = run.budget.fragments
        try:
            rendered = run.first(self.subject, _MOST_SECONDS)
        except (Problem, moderngl.Error) as reason:
            return BenchCell(**about, **needed(run.key, self.n), problem=why(reason))
        return BenchCell(**about, **self._facts(rendered))

    def _work(self, run: Run) -> dict[str, PassWork]:
        """Empty where the driver does not take the shaders that tally."""
        try:
            return run.work(self.subject)
        except moderngl.Error as reason:
            self.late.append(f"the work of {said(run.key)} ({why(reason)})")
            return {}

    def _facts(self, rendered: Rendered) -> dict[str, Any]:
        error = None if self._exact is None else metrics.mse(display8(rendered.linear), self._exact)
        return {
            "mse": error,
            "captured_fragments": rendered.captured,
            "pool_bytes": rendered.pool_bytes,
            "pixel_bytes": rendered.pixel_bytes,
            "early_bytes": rendered.early_bytes,
            "total_bytes": rendered.compared_bytes,
        }


def said(key: CellKey) -> str:
    """A cell in words."""
    return key.technique if key.budget_factor is None else f"{key.technique} at F = {key.budget_factor:g} WH"
