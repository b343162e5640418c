"""Stage `evaluate`: real pictures of every technique, within every budget, against the exact one.

Techniques that do not depend on the bundle (`baseline`) and the bundle itself (`bundle`) are separate artifacts, so
that a new bundle renders only its own pictures.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from renderer.frame import Frame
from renderer.techniques import KBuffer, KBufferDeep, KBufferImportance, KBufferOptimal
from schemas.measurement import Measurement
from services.stages.label import LabelledView
from services.stages.shots import Session, Shot
from services.stages.workspace import Workspace
from services.store import Address
from services.versions import code_version

_SOURCES = (
    "labeller.curves",
    *(f"renderer.{name}" for name in ("allocation", "features", "metrics", "shaders", "techniques")),
    *(f"services.stages.{name}" for name in ("evaluate", "shots", "pictures")),
)

Kind = Literal["baseline", "bundle"]


@dataclass(frozen=True, slots=True)
class EvaluatedView:
    """Measurements and pictures of one view.

    Attributes:
        labelled: The view.
        measurements: Of all techniques and budgets.
        folders: Where the pictures are, by technique.
    """

    labelled: LabelledView
    measurements: tuple[Measurement, ...]
    folders: dict[str, Path]


def evaluate_views(
    work: Workspace,
    views: Iterable[LabelledView],
    bundle: Path,
    bundle_digest: str,
    kinds: tuple[Kind, ...] = ("baseline", "bundle"),
) -> tuple[EvaluatedView, ...]:
    """Render and measure views with the baselines, the oracle and a bundle.

    Args:
        work: The build.
        views: Labelled views.
        bundle: The bundle's folder.
        bundle_digest: Hash of its files.
        kinds: Which of the two kinds of technique.
    """
    listed = list(views)
    evaluated = []
    with work.progress.stage("evaluate pictures", len(kinds) * len(listed)) as stage:
        for view in listed:
            # The frame's opaque and gather passes serve both kinds, if either has to be rendered at all.
            session = Session(work, view)
            folders: dict[str, Path] = {}
            measurements: list[Measurement] = []
            for kind in kinds:
                folder = _evaluate(session, kind, bundle, bundle_digest)
                records = json.loads((folder / "measurements.json").read_text(encoding="utf-8"))
                made = [Measurement.model_validate({**record, "scene": view.scene.label}) for record in records]
                folders |= {m.technique: folder for m in made}
                measurements += made
                stage.advance(1, f"{view.scene.label} {view.rendered.view.name} {kind}")
            evaluated.append(EvaluatedView(view, tuple(measurements), folders))
    return tuple(evaluated)


def _evaluate(session: Session, kind: Kind, bundle: Path, bundle_digest: str) -> Path:
    work, view = session.work, session.view
    options = work.options
    inputs = [view.rendered.address.key, view.address.key, *([bundle_digest] if kind == "bundle" else [])]
    params = {"kind": kind, "budgets": list(work.budgets), "tail": options.tail, "g": options.g}
    address = Address("evaluate", code_version(*_SOURCES), inputs, params)
    folder = work.store.get(address)
    if folder is not None:
        work.progress.skipped(f"{kind} pictures already rendered")
        return folder
    work.worked = True
    with work.store.put(address) as made:
        shots = [Shot(session, made, *budget) for budget in zip(options.budgets, work.budgets, strict=True)]
        measured = _baseline(session, shots) if kind == "baseline" else _bundle(shots, bundle)
        records = [m.model_dump(mode="json", exclude={"scene"}) for m in measured]
        (made / "measurements.json").write_text(json.dumps(records), encoding="utf-8")
    return work.store.path(address)


def _baseline(session: Session, shots: list[Shot]) -> list[Measurement]:
    total = session.view.rendered.total
    measured = [Shot(session, shots[0].folder, total / session.frame.pixels, total).take_exact()]
    for shot in shots:

        def oracle(frame: Frame, fragments: int = shot.fragments) -> KBufferOptimal:
            full_size = frame is session.frame
            return KBufferOptimal(session.view.optimal(fragments) if full_size else np.ones(frame.pixels, np.int32))

        measured.append(shot.take(KBuffer.name, lambda _: KBuffer()))
        measured.append(shot.take(KBufferImportance.name, lambda _: KBufferImportance()))
        measured.append(shot.take(KBufferOptimal.name, oracle))
    return measured


def _bundle(shots: list[Shot], bundle: Path) -> list[Measurement]:
    technique = KBufferDeep(bundle)
    return [shot.take(technique.name, lambda _: technique) for shot in shots]
