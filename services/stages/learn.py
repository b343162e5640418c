"""Stages `train` and `export`: from the training views' rows to a bundle whose three forms agree."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schemas.bundle import Provenance, TailSpec
from schemas.measurement import TrainingPoint
from services.stages.label import METRIC, SHARD, LabelledView
from services.stages.scenes import scene_version
from services.stages.workspace import SceneEntry, Workspace
from services.store import Address
from services.versions import code_version, diaphane_version, machine

PARITY_ROWS = 100_000
"""Real inputs on which torch, ONNX and GLSL must agree."""

_TRAIN_SOURCES = tuple(
    f"trainer.{name}" for name in ("checkpoint", "dataset", "evaluate", "loss", "models", "train", "weights")
)
_EXPORT_SOURCES = (
    *(f"trainer.{name}" for name in ("bundle", "export_glsl", "export_onnx", "parity")),
    "schemas.bundle",
)


@dataclass(frozen=True, slots=True)
class Bundle:
    """An exported bundle.

    Attributes:
        folder: Where it is.
        history: How its training went.
    """

    folder: Path
    history: tuple[TrainingPoint, ...]


def learn(work: Workspace, scenes: Sequence[SceneEntry], views: Sequence[LabelledView]) -> Bundle:
    """Train on the views of the scenes that are not held out, and export.

    Args:
        work: The build.
        scenes: All scenes, for the provenance.
        views: All labelled views.

    Raises:
        Problem: There is nothing to learn from, or the exported forms do not agree.
    """
    training = [view for view in views if not view.scene.held_out]
    train = _train_address(work, training)
    folder = work.store.get(train)
    if folder is None:
        work.worked = True
        _train(work, training, train)
        folder = work.store.path(train)
    else:
        work.progress.skipped("models already trained")
    export = Address(
        "export",
        code_version(*_EXPORT_SOURCES),
        (train.key,),
        {"name": work.options.name, "scenes": _hashes(scenes, True)},
    )
    bundle = work.store.get(export)
    if bundle is None:
        work.worked = True
        _export(work, scenes, training, folder, export)
        bundle = work.store.path(export)
    else:
        work.progress.skipped("bundles already exported")
    history = json.loads((folder / "history.json").read_text(encoding="utf-8"))
    return Bundle(bundle, tuple(TrainingPoint.model_validate(point) for point in history))


def _train_address(work: Workspace, training: Sequence[LabelledView]) -> Address:
    # An asset's label decides which views are weighted together, so it belongs to the key with its views.
    inputs = [f"{view.scene.digest}:{view.address.key}" for view in training]
    params: dict[str, Any] = {"seed": work.options.seed, "steps": work.options.steps}
    return Address("train", code_version(*_TRAIN_SOURCES, __name__), inputs, params)


def _train(work: Workspace, training: Sequence[LabelledView], address: Address) -> None:
    from trainer.dataset import load_shards
    from trainer.train import TrainConfig, train
    from trainer.weights import save_weights

    config = TrainConfig(seed=work.options.seed)
    if work.options.steps is not None:
        config = config.model_copy(update={"steps": work.options.steps})
    data = load_shards([view.folder / SHARD for view in training], [view.scene.digest for view in training])
    # Interrupted, the same command continues from here; the artifact's key names exactly this training.
    checkpoint = work.options.state / "checkpoints" / f"{address.key}.safetensors"
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    with work.progress.stage("train", config.steps) as stage, work.store.put(address) as made:
        done = 0

        def progress(step: int, steps: int, loss: float, score: float) -> None:
            nonlocal done
            stage.advance(step - done, f"loss {loss:.3f}, error / optimum {score:.2f}")
            done = step

        # No held-out view has a say in which state is kept: they are for the evaluation alone.
        result = train(data, (), config, progress, checkpoint)
        save_weights(made / "weights.safetensors", result.weights)
        points = [
            TrainingPoint(step=point.step, loss=point.loss, over_optimum=point.score).model_dump()
            for point in result.history
        ]
        (made / "history.json").write_text(json.dumps(points), encoding="utf-8")
        (made / "config.json").write_text(config.model_dump_json(), encoding="utf-8")
    checkpoint.unlink(missing_ok=True)


def _export(
    work: Workspace, scenes: Sequence[SceneEntry], training: Sequence[LabelledView], trained: Path, address: Address
) -> None:
    from renderer.context import gl_context
    from trainer.bundle import Description, export_bundle
    from trainer.weights import load_weights

    options = work.options
    description = Description(
        name=options.name,
        tail=TailSpec(name=options.tail, g=options.g),
        metric=METRIC,
        k_min=1,
        provenance=Provenance(
            scenes=_hashes(scenes, held_out=False),
            holdout=_hashes(scenes, held_out=True),
            code_version=code_version(*_TRAIN_SOURCES, *_EXPORT_SOURCES) + scene_version()[:8],
            seed=options.seed,
            machine=", ".join(machine().values()),
            settings={
                "diaphane": diaphane_version(),
                "alpha": options.alpha,
                "size": [options.width, options.height],
                "budgets": list(options.budgets),
                "views": len(training),
                "training": json.loads((trained / "config.json").read_text(encoding="utf-8")),
            },
        ),
        evaluation={"training": json.loads((trained / "history.json").read_text(encoding="utf-8"))[-1]},
    )
    with work.progress.stage("export and parity", 1) as stage, work.store.put(address) as made:
        weights = load_weights(trained / "weights.safetensors")
        manifest = export_bundle(made, weights, description, _parity_inputs(training), gl_context())
        worst = max(manifest.parity.torch_onnx, manifest.parity.torch_glsl)
        stage.advance(1, f"{manifest.parity.count:,} inputs, largest difference {worst:.1e}")


def _parity_inputs(training: Sequence[LabelledView]) -> NDArray[np.float32]:
    """Rows spread over all training views: at least `PARITY_ROWS`, or all there are."""
    from labeller.shards import read_shard

    rows = np.concatenate([read_shard(view.folder / SHARD).features for view in training])
    return rows[:: max(1, len(rows) // PARITY_ROWS)]


def _hashes(scenes: Sequence[SceneEntry], held_out: bool) -> dict[str, str]:
    return {scene.label: scene.digest for scene in scenes if scene.held_out == held_out}
