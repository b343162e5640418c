"""A bundle whose three forms (torch, ONNX, GLSL) agree on real inputs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.versions import diaphane_version, machine
from labeller.shards import read_shard
from renderer.context import gl_context
from schemas.bundle import WEIGHTS, Provenance, TailSpec
from schemas.bundle_files import bundle_digest
from schemas.canonical import file_sha256
from schemas.glass import DEFAULT_GLASS
from schemas.pixel_weights import DEFAULT_WEIGHTS
from stages.desk import BUNDLE, SHARD, Desk, load_facts
from stages.export import ExportFacts, ExportParams
from stages.inputs import METRIC, TrainFacts
from stages.tasks import Report, Task
from trainer.bundle import Description, export_bundle
from trainer.weights import load_weights

PARITY_ROWS = 100_000
"""Real inputs on which torch, ONNX and GLSL must agree."""


def make(desk: Desk, task: Task, params: ExportParams, folder: Path, report: Report) -> ExportFacts:
    """Writes the bundle.

    Raises:
        Problem: The exported forms do not agree.
    """
    trained = desk.artifact(task, "train")
    shards = [desk.store.fetch(need) / SHARD for need in task.needs if need.startswith("label/")]
    weights = load_weights(trained / WEIGHTS)
    description = _description(params, load_facts(trained, TrainFacts), len(shards))
    bundle = folder / BUNDLE
    manifest = export_bundle(bundle, weights, description, _parity_inputs(shards), gl_context())
    report(1.0, f"{manifest.parity.count:,} inputs, largest difference {manifest.parity.worst:.1e}")
    files = {path.name: file_sha256(path) for path in sorted(bundle.iterdir())}
    return ExportFacts(digest=bundle_digest(bundle), files=files, parity=manifest.parity.worst)


def _description(params: ExportParams, trained: TrainFacts, views: int) -> Description:
    settings = params.settings
    return Description(
        name=params.name,
        tail=TailSpec(name=settings.tail, g=settings.g),
        metric=METRIC,
        provenance=Provenance(
            scenes=params.scenes,
            holdout=params.holdout,
            licences=params.licences,
            code_version=params.code,
            seed=settings.seed,
            machine=", ".join(machine().values()),
            settings={
                "diaphane": diaphane_version(),
                "alpha": settings.alpha,
                "size": list(settings.size),
                "budgets": list(settings.budgets),
                **({"glass": settings.glass} if settings.glass != DEFAULT_GLASS else {}),
                **({"weights": settings.weights} if settings.weights != DEFAULT_WEIGHTS else {}),
                "views": views,
                "training": trained.config,
            },
        ),
        evaluation={"training": trained.history[-1].model_dump()},
    )


def _parity_inputs(shards: Sequence[Path]) -> NDArray[np.float32]:
    """Rows spread over all training views: at least `PARITY_ROWS`, or all there are."""
    rows = np.concatenate([read_shard(shard).features for shard in shards])
    return rows[:: max(1, len(rows) // PARITY_ROWS)]
