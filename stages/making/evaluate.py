"""Real pictures of every technique, within every budget, against the exact one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.frame import Frame
from renderer.techniques import Budget, KBuffer, KBufferDeep, KBufferImportance, KBufferOptimal
from schemas.measurement import Measurement
from stages.allocations import read_allocation
from stages.desk import Desk
from stages.evaluate import EvaluateParams
from stages.inputs import EvaluateFacts
from stages.shots import Session, Shot
from stages.tasks import Report, Task


def make(desk: Desk, task: Task, params: EvaluateParams, folder: Path, report: Report) -> EvaluateFacts:
    """Writes the pictures.

    Raises:
        Problem: A GL picture differs from the CPU simulation of the same allocation.
    """
    measured = (_baseline if params.kind == "baseline" else _bundle)(desk, task, params, folder, report)
    return EvaluateFacts(measurements=tuple(measured))


def _shots(session: Session, folder: Path) -> list[Shot]:
    params = session.params
    return [Shot(session, folder, *budget) for budget in zip(params.factors, params.budgets, strict=True)]


def _baseline(desk: Desk, task: Task, params: EvaluateParams, folder: Path, report: Report) -> list[Measurement]:
    session = Session(desk, task, params)
    shots, total, labels = _shots(session, folder), session.dump.total, desk.artifact(task, "label")
    measured = [Shot(session, folder, total / session.frame.pixels, total).take_exact()]
    for number, shot in enumerate(shots, start=1):

        def oracle(frame: Frame, _: Budget, fragments: int = shot.fragments) -> NDArray[np.int32]:
            full_size = frame is session.frame
            return read_allocation(labels, "optimal", fragments) if full_size else np.ones(frame.pixels, np.int32)

        measured += [shot.take(technique) for technique in (KBuffer(), KBufferImportance(), KBufferOptimal(oracle))]
        report(number / len(shots), f"{number} of {len(shots)} budgets")
    return measured


def _bundle(desk: Desk, task: Task, params: EvaluateParams, folder: Path, report: Report) -> list[Measurement]:
    technique = KBufferDeep(desk.bundle(task))
    shots = _shots(Session(desk, task, params, technique.manifest.tail), folder)
    measured = []
    for number, shot in enumerate(shots, start=1):
        measured.append(shot.take(technique))
        report(number / len(shots), f"{number} of {len(shots)} budgets")
    return measured
