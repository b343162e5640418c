"""The task of every stage: what an artifact is made from decides where it lies. Loads no renderer and no trainer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Literal

from schemas.bundle import network_digest
from schemas.pixel_weights import DEFAULT_WEIGHTS
from schemas.view import View
from services.closure import Tree
from services.plan import Plan, PlannedScene
from services.records import LabelledView, RenderedView, SceneEntry
from services.stages.inputs import METRIC, REPLAYED
from services.tasks import Source, StageName, Task

EvaluationKind = Literal["baseline", "bundle"]

MODULES: Mapping[StageName, str] = {
    "scene": "services.stages.scenes",
    "render": "services.stages.render",
    "label": "services.stages.label",
    "train": "services.stages.train",
    "export": "services.stages.export",
    "evaluate": "services.stages.evaluate",
    "report": "services.stages.report",
}
"""Stage -> the module that makes it. It decides the result, with all that it imports: a change of any of that makes
the stage's artifacts anew."""


def version_of(stage: StageName) -> str:
    """Code version of a stage in this process: part of the address of whatever it makes."""
    return _versions()[0][stage]


@cache
def _versions() -> tuple[dict[StageName, str], str]:
    """Of all stages at once: where files change under a running process, none may be newer than the others."""
    tree = Tree()
    stages = {stage: tree.version(module) for stage, module in MODULES.items()}
    return stages, tree.version(MODULES["train"], MODULES["export"])


def training_version() -> str:
    """Code version of whatever decides what a bundle is, for its provenance."""
    return _versions()[1]


def scene_task(plan: Plan, scene: PlannedScene) -> Task:
    """Reads a stage: its views, and what was found in it."""
    return Task(
        name=scene.label,
        stage="scene",
        version=version_of("scene"),
        inputs=(scene.source.digest,),
        params={
            "alpha": plan.alpha,
            "glass": plan.glass,
            "views": [view.model_dump(mode="json") for view in scene.listed],
            "count": plan.views_per_scene,
            "seed": plan.seed,
        },
        scene=scene.source,
    )


def render_task(plan: Plan, scene: SceneEntry, view: View) -> Task:
    """Captures the fragments of a view."""
    return Task(
        name=f"{scene.label} {view.name}",
        stage="render",
        version=version_of("render"),
        inputs=(scene.digest,),
        params=_picture(plan, view),
        scene=scene.source,
    )


def label_task(plan: Plan, view: RenderedView) -> Task:
    """Error curves, allocations and training rows of a view, all budgets in one task."""
    return Task(
        name=view.title,
        stage="label",
        version=version_of("label"),
        inputs=(view.task.address.key,),
        params={**_allocation(plan), "metric": METRIC, "seed": plan.seed, **_weights(plan)},
        needs=(view.task.artifact,),
    )


def train_task(
    plan: Plan, shards: Sequence[tuple[str, str]], start: Source | None, config: Mapping[str, Any] | None = None
) -> Task:
    """Trains the network.

    Args:
        plan: Seed, steps, size of the network, patience, and what is replayed.
        shards: Digest of the asset and label artifact of every training view: an asset's label decides which views are
            weighted together, so it belongs to the key.
        start: Bundle whose weights the training begins with.
        config: Further settings of the trainer.
    """
    params: dict[str, Any] = {"seed": plan.seed, "steps": plan.steps, "network": plan.network, **(config or {})}
    inputs = [f"{digest}:{artifact.partition('/')[2]}" for digest, artifact in shards]
    inputs += [f"{digest}:{artifact.partition('/')[2]}{REPLAYED}" for digest, artifact in plan.replayed]
    if plan.patience:
        params["patience"] = plan.patience
    if start is not None:
        params["start"] = start.digest
    if plan.replay is not None:
        params["replay"] = plan.replay.digest
    return Task(
        name=plan.name,
        stage="train",
        version=version_of("train"),
        inputs=tuple(inputs),
        params=params,
        needs=tuple(artifact for _, artifact in (*shards, *plan.replayed)),
        bundle=start,
        replay=plan.replay,
    )


def export_task(
    plan: Plan, train: Task, scenes: Mapping[str, str], held_out: Mapping[str, str], licences: Mapping[str, str]
) -> Task:
    """Writes the bundle, if its three forms agree.

    Args:
        plan: Name, tail and settings.
        train: The training.
        scenes: Label -> digest of what was trained on.
        held_out: Label -> digest of what was not.
        licences: Label -> licence of all of them, as far as they are known.
    """
    return Task(
        name=plan.name,
        stage="export",
        version=version_of("export"),
        inputs=(train.address.key,),
        params={
            "name": plan.name,
            "scenes": dict(scenes),
            "holdout": dict(held_out),
            "licences": dict(licences),
            "settings": plan.settings,
            "code": training_version(),
        },
        needs=(train.artifact, *train.needs),
    )


def evaluate_task(
    plan: Plan, view: LabelledView, kind: EvaluationKind, bundle: Source | None = None, export: Task | None = None
) -> Task:
    """Renders and measures a view: with the techniques that need no bundle, or with a bundle.

    Args:
        plan: Budgets and picture.
        view: The view.
        kind: `baseline` or `bundle`.
        bundle: The bundle, for its digest and, if it is published, its files.
        export: The task that exported it, if it is not published.
    """
    made_from = [view.rendered.task.address.key, view.task.address.key]
    needs = [view.rendered.task.artifact, view.task.artifact]
    if export is not None:
        needs.append(export.artifact)
    published = bundle is not None and export is None
    return Task(
        name=f"{view.rendered.title} {'published ' if published else ''}{kind}",
        stage="evaluate",
        version=version_of("evaluate"),
        inputs=(*made_from, _network(bundle)) if bundle is not None else tuple(made_from),
        params={
            "kind": kind,
            **_picture(plan, view.rendered.view),
            **_allocation(plan),
            "factors": list(plan.factors),
        },
        needs=tuple(needs),
        scene=view.scene.source,
        bundle=bundle,
    )


def evaluated_from(inputs: Sequence[str]) -> tuple[str, str]:
    """The artifacts (`stage/key`) of fragments and of labels that an evaluation was made from.

    Args:
        inputs: Of its address.
    """
    return f"render/{inputs[0]}", f"label/{inputs[1]}"


def report_task(name: str, data: Mapping[str, Any], evaluations: Sequence[tuple[str, Task]]) -> Task:
    """Writes the HTML report.

    Args:
        name: Of the report.
        data: `schemas.measurement.ReportData` without measurements, JSON.
        evaluations: Label of the scene and task, for every evaluation that is shown.
    """
    return Task(
        name=name,
        stage="report",
        version=version_of("report"),
        inputs=tuple(task.address.key for _, task in evaluations),
        params={"data": dict(data), "labels": [label for label, _ in evaluations]},
        needs=tuple(task.artifact for _, task in evaluations),
    )


def _network(bundle: Source) -> str:
    """Names the network of a bundle: its pictures are the same before and after it has a model card."""
    return network_digest(bundle.files) if bundle.files else bundle.digest


def _picture(plan: Plan, view: View) -> dict[str, Any]:
    size = [plan.width, plan.height]
    return {"view": view.model_dump(mode="json"), "size": size, "alpha": plan.alpha, "glass": plan.glass}


def _weights(plan: Plan) -> dict[str, Any]:
    return {"weights": plan.weights} if plan.weights != DEFAULT_WEIGHTS else {}


def _allocation(plan: Plan) -> dict[str, Any]:
    return {"budgets": list(plan.budgets), "tail": plan.tail, "g": plan.g}
