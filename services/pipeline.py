"""The only place that knows the order of the stages: of the main job, and of the parts of it that can be asked for."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evaluation import summary
from evaluation.advice.gathered import of_measurements
from schemas.bundle import load_manifest, network_digest, write_card
from schemas.bundle_files import bundle_digest
from schemas.job import JobSpec
from schemas.measurement import Measurement, RegistryResult, SceneSummary
from schemas.problem import ExitCode, Problem
from schemas.service import SceneRecord, ShardRef
from services import budgets, steps
from services.acceptance import begun_plan
from services.fine_tuning import without_champion
from services.model_card import command_of, model_card
from services.registry import Publication
from services.runner import Runner
from stages.desk import BUNDLE, PAGE
from stages.evaluate import EVALUATE
from stages.plan import Plan, plan_of_job, source_of_version
from stages.records import Bundle, EvaluatedView, LabelledView, RenderedView, SceneEntry
from stages.report import REPORT
from stages.tasks import Source, Task


@dataclass(frozen=True, slots=True)
class Built:
    """What the main job found and made.

    Attributes:
        plan: What was asked for, with its budgets.
        scenes: All scenes.
        views: All labelled views.
        bundle: The exported bundle.
        evaluated: The views that it was measured on: of held-out scenes, or of all if none is held out.
        registered: What became of the bundle.
        rival_score: The champion's score on the same held-out views, if it could be compared.
        rival: The champion's measurements on them.
    """

    plan: Plan
    scenes: tuple[SceneEntry, ...]
    views: tuple[LabelledView, ...]
    bundle: Bundle
    evaluated: tuple[EvaluatedView, ...]
    registered: RegistryResult
    rival_score: float | None
    rival: tuple[Measurement, ...]


def build(plan: Plan, runner: Runner) -> Built:
    """From scenes to a published bundle. What exists already is not made again.

    Raises:
        Problem: Bad input, no GL driver, or a check that does not hold.
    """
    scenes = steps.read_scenes(plan, runner)
    rendered = steps.render_views(plan, runner, scenes)
    plan = budgets.decided(plan, rendered, runner.progress)
    views = steps.label_views(plan, runner, rendered)
    champion = _champion(plan, runner)
    bundle = _learn(plan, runner, scenes, views, champion)
    judged = [view for view in views if view.scene.held_out] or list(views)
    evaluated = steps.evaluate_views(plan, runner, judged, bundle.source, bundle.task)
    held_out = [view for view in evaluated if view.labelled.scene.held_out]
    rival = _rival(plan, runner, held_out, champion, bundle)
    registered, rival_score = _publish(plan, runner, bundle, held_out, rival)
    _record(runner, evaluated, registered.reference)
    return Built(plan, scenes, views, bundle, evaluated, registered, rival_score, rival)


def report_data(built: Built, command: str, created: str, skipped: Mapping[str, int]) -> dict[str, Any]:
    """What the report shows, JSON, apart from what `stages.making.report.write` finds out itself."""
    judged = [view.labelled for view in built.evaluated]
    scenes = [_scene_summary(scene, [view.rendered for view in built.views]) for scene in built.scenes]
    return {
        "name": built.plan.name,
        "command": command,
        "created": created,
        "scenes": [scene.model_dump(mode="json") for scene in scenes],
        "certificates": [c.model_dump(mode="json") for view in judged for c in view.certificates],
        "training": [point.model_dump(mode="json") for point in built.bundle.history],
        "registry": built.registered.model_dump(mode="json"),
        "skipped": dict(skipped),
        "provenance": {
            "seed": built.plan.options.seed,
            "tail": built.plan.options.tail,
            "g": built.plan.options.g,
            "alpha": built.plan.options.alpha,
            "bundle": built.bundle.facts.digest,
            "scenes": {scene.label: scene.digest for scene in built.scenes},
        },
    }


@dataclass(frozen=True, slots=True)
class JobContext:
    """The job that a run belongs to: its id, and when it was submitted (ISO 8601, UTC)."""

    id: str
    created: str


def run_job(spec: JobSpec, scenes: Mapping[str, SceneRecord], runner: Runner, job: JobContext) -> dict[str, Any]:
    """A job of the service.

    Args:
        spec: The job as submitted.
        scenes: Records of its scenes, by id.
        runner: Does the tasks.
        job: Which job it is.

    Returns:
        The job's result, JSON: what its kind makes.

    Raises:
        Problem: Bad input, or a check that does not hold.
    """
    plan = begun_plan(spec, plan_of_job(spec, scenes), runner.registry, runner.measured, runner.store).plan
    if spec.kind == "build":
        return _build_job(plan, runner, job)
    if spec.kind == "train" and spec.dataset is not None:
        return _train_on_dataset(plan, runner, spec.dataset)
    entries = steps.read_scenes(plan, runner)
    rendered = steps.render_views(plan, runner, entries)
    if spec.kind == "render":
        return {"views": [_view_result(view) for view in rendered]}
    plan = budgets.decided(plan, rendered, runner.progress)
    views = steps.label_views(plan, runner, rendered)
    dataset = _record_dataset(plan, runner, views)
    if spec.kind == "train":
        champion = _champion(plan, runner)
        return {"dataset": dataset, **_publish_unscored(plan, runner, _learn(plan, runner, entries, views, champion))}
    if spec.kind == "evaluate":
        return {"dataset": dataset, **_evaluate_job(plan, runner, views, spec.model)}
    return {"dataset": dataset, "views": [_view_result(view.rendered) for view in views]}


def _build_job(plan: Plan, runner: Runner, job: JobContext) -> dict[str, Any]:
    built = build(plan, runner)
    held_out = [m for view in built.evaluated if view.labelled.scene.held_out for m in view.measurements]
    baseline = [m for m in held_out if m.technique != summary.BUNDLE]
    rival = [*baseline, *built.rival] if built.rival else []
    labels = sorted({m.scene for m in held_out})
    data = report_data(built, f"diaphane jobs show {job.id}", job.created, runner.progress.skips)
    shown = [(view.labelled.scene.label, task) for view in built.evaluated for task in view.tasks]
    report = _keep_report(runner, REPORT.ask(plan.name, data, shown))
    return {
        "reference": built.registered.reference,
        "score": built.registered.score,
        "champion": built.registered.champion,
        "reason": built.registered.reason,
        "rival_score": built.rival_score,
        "per_scene": {
            label: {
                "score": summary.score(m for m in held_out if m.scene == label),
                "rival": summary.score(m for m in rival if m.scene == label),
            }
            for label in labels
        },
        "dataset": _record_dataset(plan, runner, built.views),
        "report": report,
    }


def _evaluate_job(plan: Plan, runner: Runner, views: Sequence[LabelledView], model: str | None) -> dict[str, Any]:
    publication = None if model is None else _meant(runner, model)
    bundle = None if publication is None else source_of_version(runner.registry.record(publication))
    evaluated = steps.evaluate_views(plan, runner, views, bundle, None)
    reference = None if publication is None else f"{publication.name}@{publication.version}"
    _record(runner, evaluated, reference)
    measured = [m for view in evaluated for m in view.measurements]
    labels = sorted({m.scene for m in measured})
    advised = {
        label: of_measurements(label, [(m, reference or "") for m in measured if m.scene == label]) for label in labels
    }
    return {
        "reference": reference,
        "score": summary.score(measured),
        "per_scene": {label: {"score": summary.score(m for m in measured if m.scene == label)} for label in labels},
        "advice": {label: list(advice.text) for label, advice in advised.items() if advice is not None},
    }


def _meant(runner: Runner, model: str) -> Publication:
    """The version that a reference means when the job first asks."""
    version = runner.step("resolve model", lambda: runner.registry.resolve(model).version)
    return runner.registry.resolve(f"{model.partition('@')[0]}@{version}")


def _train_on_dataset(plan: Plan, runner: Runner, dataset: str) -> dict[str, Any]:
    record = runner.measured.dataset(dataset)
    shards = [(shard.scene_digest, shard.artifact) for shard in record.shards]
    scenes = {shard.scene: shard.scene_digest for shard in record.shards}
    start = _start(plan, runner, _champion(plan, runner))
    plan = plan.described_by(record.settings)
    learned = _all_learned(plan, scenes)
    licences = _licences(learned, {**plan.licences, **record.settings.get("licences", {})})
    bundle = steps.learn(plan, runner, shards, learned, {}, licences, start)
    return {"dataset": dataset, **_publish_unscored(plan, runner, bundle)}


def _learn(
    plan: Plan,
    runner: Runner,
    scenes: Sequence[SceneEntry],
    views: Sequence[LabelledView],
    champion: Publication | None,
) -> Bundle:
    shards = [(view.scene.digest, view.task.artifact) for view in views if not view.scene.held_out]
    if not shards:
        raise Problem("No training view is left.", "See why the tasks failed, or add scenes.", ExitCode.CHECK_FAILED)
    trained, held_out = (
        {scene.label: scene.digest for scene in scenes if scene.held_out == held} for held in (False, True)
    )
    learned = _all_learned(plan, trained)
    licences = _licences({**learned, **held_out}, {**plan.licences, **_stated(scenes)})
    return steps.learn(plan, runner, shards, learned, held_out, licences, _start(plan, runner, champion))


def _stated(scenes: Iterable[SceneEntry]) -> dict[str, str]:
    """Digest -> licence of the scenes that state one."""
    return {scene.digest: scene.licence for scene in scenes if scene.licence}


def _licences(scenes: Mapping[str, str], known: Mapping[str, str]) -> dict[str, str]:
    """Label -> licence of the scenes whose licence is known.

    Args:
        scenes: Label -> digest.
        known: Digest -> licence.
    """
    return {label: known[digest] for label, digest in scenes.items() if digest in known}


def _all_learned(plan: Plan, trained: Mapping[str, str]) -> dict[str, str]:
    """Label -> digest of what a network has learned when it has been trained, now and before."""
    # A scene that was learned under a name which another one has now keeps a name of its own.
    known = {label if label not in trained else f"{label}@{d[:8]}": d for label, d in plan.learned.items()}
    known = {label: digest for label, digest in known.items() if digest not in trained.values()}
    return {**known, **trained}


def _champion(plan: Plan, runner: Runner) -> Publication | None:
    """The name's champion when the job first asked.

    A job that is taken over asks again, and may have made its own version the champion meanwhile: it would train anew
    from that one, or not find the rival that it was compared with.
    """

    def body() -> str | None:
        found = runner.registry.champion(plan.name)
        return None if found is None else found.version

    version = runner.step("find champion", body)
    return None if version is None else runner.registry.resolve(f"{plan.name}@{version}")


def _start(plan: Plan, runner: Runner, champion: Publication | None) -> Source | None:
    """The weights that the training begins with: without a champion yet, from scratch."""
    if plan.start is not None or not plan.from_champion:
        return plan.start
    if champion is None:
        runner.progress.note(without_champion(plan.name))
        return None
    return source_of_version(runner.registry.record(champion))


def _rival(
    plan: Plan,
    runner: Runner,
    held_out: Sequence[EvaluatedView],
    champion: Publication | None,
    bundle: Bundle,
) -> tuple[Measurement, ...]:
    """The champion on the same views; nothing if there is no other one, or it was trained on one of their scenes."""
    if champion is None or not held_out:
        return ()
    source = source_of_version(runner.registry.record(champion))
    if network_digest(source.files) == bundle.network:
        return ()
    trained_on = set(load_manifest(runner.registry.folder(champion)).provenance.scenes.values())
    if trained_on & {view.labelled.scene.digest for view in held_out}:
        return ()
    return steps.measure_rival(plan, runner, held_out, source)


def _publish(
    plan: Plan, runner: Runner, bundle: Bundle, held_out: Sequence[EvaluatedView], rival: Sequence[Measurement]
) -> tuple[RegistryResult, float | None]:
    """Publishes a bundle with its score on the held-out views; the better one of it and the champion is champion."""
    measured = [m for view in held_out for m in view.measurements]
    score = summary.score(measured)
    baseline = [m for m in measured if m.technique != summary.BUNDLE]
    rival_score = summary.score([*baseline, *rival]) if rival and score is not None else None
    evaluation = {
        "views": sorted(view.labelled.rendered.task.address.key for view in held_out),
        "budgets": list(plan.budgets),
        "tail": plan.options.tail,
        "g": plan.options.g,
    }

    def body() -> dict[str, Any]:
        publication, known = _into_registry(plan, runner, bundle, score, evaluation, measured)
        promoted, reason = runner.registry.consider(
            publication, score, rival_score, who=runner.who, promote=plan.promote
        )
        result = RegistryResult(
            reference=f"{publication.name}@{publication.version}",
            folder=str(runner.registry.folder(publication)),
            champion=promoted,
            reason=reason,
            score=score,
        )
        return {"known": known, "result": result.model_dump(mode="json")}

    return RegistryResult.model_validate(_published(runner, body)), rival_score


def _publish_unscored(plan: Plan, runner: Runner, bundle: Bundle) -> dict[str, Any]:
    """Publishes what was not measured: a version without a score, which nothing promotes by itself."""

    def body() -> dict[str, Any]:
        publication, known = _into_registry(plan, runner, bundle, None, {}, ())
        _, reason = runner.registry.consider(publication, None, None, who=runner.who, promote=False)
        reference = f"{publication.name}@{publication.version}"
        result = {"reference": reference, "score": None, "champion": False, "reason": reason}
        return {"known": known, "result": result}

    return _published(runner, body)


def _published(runner: Runner, body: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Publishes once; a job that is taken over afterwards counts the same skips."""
    outcome = runner.step("publish", body)
    if outcome["known"]:
        runner.progress.skipped("bundles already published")
    result: dict[str, Any] = outcome["result"]
    return result


def _into_registry(
    plan: Plan,
    runner: Runner,
    bundle: Bundle,
    score: float | None,
    evaluation: Mapping[str, Any],
    measured: Sequence[Measurement],
) -> tuple[Publication, bool]:
    """The version of a bundle with its model card, and whether it was published before."""
    artifacts = (bundle.task.artifact, *bundle.task.needs)
    with tempfile.TemporaryDirectory() as work:
        folder = Path(shutil.copytree(runner.store.fetch(bundle.task.artifact) / BUNDLE, Path(work) / BUNDLE))
        write_card(folder, model_card(load_manifest(folder), command_of(plan), measured))
        digest = bundle_digest(folder)
        known = digest in {publication.digest for publication in runner.registry.versions(bundle.name)}
        made = runner.registry.publish(
            bundle.name, folder, score, evaluation, artifacts=artifacts, job_id=runner.job_id
        )
    return made, known


def _record(runner: Runner, evaluated: Sequence[EvaluatedView], reference: str | None) -> None:
    """Keeps the measurements, so that they can be asked for."""

    def body() -> int:
        for view in evaluated:
            digests = {view.labelled.scene.label: view.labelled.scene.digest}
            for task in view.tasks:
                kind = EVALUATE.params_of(task).kind
                own = [m for m in view.measurements if (m.technique == summary.BUNDLE) == (kind == "bundle")]
                model = reference if kind == "bundle" else None
                runner.measured.record(task.artifact, own, digests, model, runner.job_id)
        return len(evaluated)

    runner.step("record measurements", body)


def _record_dataset(plan: Plan, runner: Runner, views: Sequence[LabelledView]) -> str:
    shards = [
        ShardRef(
            scene=view.scene.label,
            scene_digest=view.scene.digest,
            view=view.rendered.view.name,
            artifact=view.task.artifact,
            sha256=view.facts.shard.sha256,
            bytes=view.facts.shard.bytes,
        )
        for view in views
        if not view.scene.held_out
    ]

    def body() -> str:
        settings = {**plan.settings, "licences": _stated(view.scene for view in views)}
        return runner.measured.record_dataset(settings, shards, runner.job_id).id

    return str(runner.step("record data set", body))


def _keep_report(runner: Runner, task: Task) -> str | None:
    """The page as a blob, so that it can be asked for by its hash; None if it could not be written."""
    (facts,) = runner.map(REPORT.name, [task])
    if facts is None:
        return None

    def body() -> str:
        return runner.blobs.put_file(runner.store.fetch(task.artifact) / PAGE).sha256

    return str(runner.step("keep report", body))


def _view_result(view: RenderedView) -> dict[str, Any]:
    return {
        "scene": view.scene.label,
        "view": view.view.name,
        "fragments": view.total,
        "artifact": view.task.artifact,
    }


def _scene_summary(scene: SceneEntry, views: Sequence[RenderedView]) -> SceneSummary:
    return SceneSummary(
        label=scene.label,
        held_out=scene.held_out,
        views=len(scene.facts.views),
        triangles=scene.facts.triangles,
        fragments=sum(view.total for view in views if view.scene.label == scene.label),
        warnings=scene.facts.warnings,
    )
