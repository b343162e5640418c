"""The HTML page of a build, with pictures of some views."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from evaluation import summary
from evaluation.advice.gathered import of_measurements
from evaluation.advice.page import part
from evaluation.pictures import EXACT, read_png, stem
from evaluation.report import Picture, PictureSet, write_report
from evaluation.versions import library_versions, machine
from renderer.context import describe, gl_context
from schemas.canonical import file_sha256
from schemas.measurement import Measurement, ReportData
from stages.desk import PAGE, Desk, load_facts
from stages.inputs import EvaluateFacts
from stages.report import ReportFacts, ReportParams
from stages.tasks import Report, Task

SHOWN_VIEWS = 2
"""Views of each held-out scene whose pictures go into the report: more would make the file unwieldy."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """An `evaluate` artifact and what this run calls its scene.

    Attributes:
        label: Of the scene.
        folder: Of the artifact.
    """

    label: str
    folder: Path

    @property
    def measurements(self) -> list[Measurement]:
        """Of one view."""
        found = load_facts(self.folder, EvaluateFacts).measurements
        return [measured.model_copy(update={"scene": self.label}) for measured in found]


def make(desk: Desk, task: Task, params: ReportParams, folder: Path, report: Report) -> ReportFacts:
    """Writes the page."""
    shown = [Evaluation(*pair) for pair in zip(params.labels, map(desk.store.fetch, task.needs), strict=True)]
    page = write(folder / PAGE, params.data, shown)
    report(1.0, f"{page.stat().st_size / 1e6:.1f} MB")
    return ReportFacts(sha256=file_sha256(page), bytes=page.stat().st_size)


def write(path: Path, data: dict[str, Any], shown: Sequence[Evaluation]) -> Path:
    """Writes the report of a build.

    Args:
        path: The file.
        data: `ReportData`, JSON, without what can be told here: measurements, machine, versions.
        shown: Every evaluation.
    """
    complete = ReportData.model_validate(
        {
            **data,
            "measurements": [m for evaluation in shown for m in evaluation.measurements],
            "machine": {**machine(), "GL": describe(gl_context())},
            "versions": library_versions(),
        }
    )
    write_report(path, complete, _pictures(shown), list(_advice(complete)))
    return path


def _advice(data: ReportData) -> Iterator[tuple[str, Markup]]:
    """What each held-out scene should be rendered with, by what was measured."""
    label = "" if data.registry is None else data.registry.reference
    for scene in data.scenes:
        measured = [(m, label) for m in data.measurements if m.scene == scene.label]
        advice = of_measurements(scene.label, measured) if scene.held_out else None
        if advice is not None:
            yield scene.label, part(advice)


def _pictures(shown: Sequence[Evaluation]) -> Iterator[PictureSet]:
    """The first views of each scene, at the middle one of the budgets that are not exact there."""
    views: dict[tuple[str, str], list[Evaluation]] = {}
    for evaluation in shown:
        views.setdefault((evaluation.label, evaluation.measurements[0].view), []).append(evaluation)
    count: dict[str, int] = {}
    for (label, view), evaluations in views.items():
        measured = [m for evaluation in evaluations for m in evaluation.measurements]
        budgets = sorted({m.budget_factor for m in summary.compared(measured)})
        if budgets and count.get(label, 0) < SHOWN_VIEWS:
            count[label] = count.get(label, 0) + 1
            yield _picture_set(label, view, evaluations, budgets[len(budgets) // 2])


def _picture_set(label: str, view: str, evaluations: Sequence[Evaluation], factor: float) -> PictureSet:
    techniques = {}
    for evaluation in evaluations:
        for m in summary.compared(evaluation.measurements):
            if m.budget_factor == factor:
                techniques[m.technique] = _picture(evaluation.folder, stem(m.technique, factor))
    exact = next(e.folder / EXACT for e in evaluations if (e.folder / EXACT).exists())
    return PictureSet(scene=label, view=view, budget_factor=factor, exact=read_png(exact), techniques=techniques)


def _picture(folder: Path, base: str) -> Picture:
    return Picture(
        image=read_png(folder / f"{base}.png"),
        flip=read_png(folder / f"{base}.flip.png").astype(np.float32) / np.float32(255.0),
        k=read_png(folder / f"{base}.k.png"),
    )
