"""Stage `evaluate`: real pictures of every technique, within every budget, against the exact one.

Techniques that do not depend on the bundle (`baseline`) and the bundle itself (`bundle`) are separate artifacts, so
that a new bundle renders only its own pictures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.frame import Frame
from renderer.techniques import Budget, KBuffer, KBufferDeep, KBufferImportance, KBufferOptimal
from schemas.measurement import Measurement
from services.stages.allocations import read_allocation
from services.stages.desk import Desk, save_facts
from services.stages.shots import Session, Shot
from services.tasks import Report, Task


def make(desk: Desk, task: Task, folder: Path, report: Report) -> None:
    """Writes the pictures and their measurements.

    Raises:
        Problem: A GL picture differs from the CPU simulation of the same allocation.
    """
    session = Session(desk, task)
    budgets = zip(task.params["factors"], task.params["budgets"], strict=True)
    shots = [Shot(session, folder, *budget) for budget in budgets]
    kind = task.params["kind"]
    measured = _baseline(session, shots, report) if kind == "baseline" else _bundle(shots, desk.bundle(task), report)
    save_facts(folder, {"measurements": [m.model_dump(mode="json", exclude={"scene"}) for m in measured]})


def _baseline(session: Session, shots: list[Shot], report: Report) -> list[Measurement]:
    total, labels = session.dump.total, session.desk.artifact(session.task, "label")
    measured = [Shot(session, shots[0].folder, total / session.frame.pixels, total).take_exact()]
    for number, shot in enumerate(shots, start=1):

        def oracle(frame: Frame, _: Budget, fragments: int = shot.fragments) -> NDArray[np.int32]:
            full_size = frame is session.frame
            return read_allocation(labels, "optimal", fragments) if full_size else np.ones(frame.pixels, np.int32)

        measured += [shot.take(technique) for technique in (KBuffer(), KBufferImportance(), KBufferOptimal(oracle))]
        report(number / len(shots), f"{number} of {len(shots)} budgets")
    return measured


def _bundle(shots: list[Shot], bundle: Path, report: Report) -> list[Measurement]:
    technique = KBufferDeep(bundle)
    measured = []
    for number, shot in enumerate(shots, start=1):
        measured.append(shot.take(technique))
        report(number / len(shots), f"{number} of {len(shots)} budgets")
    return measured
