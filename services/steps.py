"""The steps of the pipeline: each maps one stage over what the step before it found."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

from evaluation.scene_warnings import said_warnings
from schemas.measurement import Certificate, Measurement
from schemas.problem import ExitCode, Problem
from schemas.skips import OPAQUE_SCENES, OPAQUE_VIEWS
from services.runner import Runner
from stages.evaluate import EVALUATE
from stages.export import EXPORT
from stages.inputs import EvaluateFacts
from stages.label import LABEL, LabelFacts
from stages.plan import Plan, PlannedScene
from stages.records import Bundle, EvaluatedView, LabelledView, RenderedView, SceneEntry
from stages.render import RENDER
from stages.scene import SCENE, SceneFacts
from stages.stage import F, P, Stage
from stages.tasks import Source, Task
from stages.train import TRAIN


def read_scenes(plan: Plan, runner: Runner) -> tuple[SceneEntry, ...]:
    """Views and facts of every scene.

    Raises:
        Problem: A file is not a scene, two are the same, or nothing in them is transparent.
    """
    made = _made(runner, SCENE, [SCENE.ask(plan, scene) for scene in plan.scenes])
    entries = [_entry(scene, facts) for scene, facts in zip(plan.scenes, made, strict=True) if facts is not None]
    for entry in entries:
        source = entry.source
        file = None if source.folder is None else PurePath(source.folder, source.root)
        for line in said_warnings(entry.label, entry.facts.warnings, file):
            runner.progress.note(line)
    _refuse_copies(entries)
    return _transparent(runner, entries)


def render_views(plan: Plan, runner: Runner, scenes: Sequence[SceneEntry]) -> tuple[RenderedView, ...]:
    """Dumps of all views that have a transparent fragment; the others are counted as skipped."""
    views = [(scene, view) for scene in scenes for view in scene.facts.views]
    asked = [RENDER.ask(plan, scene, view) for scene, view in views]
    rendered = []
    for (scene, view), task, facts in zip(views, asked, _made(runner, RENDER, asked), strict=True):
        if facts is None:
            continue
        if facts.total == 0:
            runner.progress.skipped(OPAQUE_VIEWS)
            continue
        rendered.append(RenderedView(scene, view, task, facts.total))
    _require_views(runner, scenes, rendered)
    return tuple(rendered)


def label_views(plan: Plan, runner: Runner, views: Sequence[RenderedView]) -> tuple[LabelledView, ...]:
    """Labels of all views: all budgets of a view in one task. What took no part in them is counted as skipped."""
    asked = [LABEL.ask(plan, view) for view in views]
    labelled = []
    for view, task, facts in zip(views, asked, _made(runner, LABEL, asked), strict=True):
        if facts is None:
            continue
        for what, count in facts.skips.items():
            if count:
                runner.progress.skipped(what, count)
        labelled.append(LabelledView(view, task, facts, _certificates(plan, view, facts)))
    return tuple(labelled)


def learn(
    plan: Plan,
    runner: Runner,
    shards: Sequence[tuple[str, str]],
    scenes: dict[str, str],
    held_out: dict[str, str],
    licences: dict[str, str],
    start: Source | None,
) -> Bundle:
    """Train and export.

    Args:
        plan: What was asked for.
        runner: Does it.
        shards: Digest of the asset and label artifact of every training view.
        scenes: Label -> digest of what is trained on.
        held_out: Label -> digest of what is not.
        licences: Label -> licence of all of them, as far as they are known.
        start: Published version whose weights the training begins with.

    Raises:
        Problem: There is nothing to learn from, or the exported forms do not agree.
    """
    train = TRAIN.ask(plan, shards, start)
    (trained,) = _made(runner, TRAIN, [train])
    export = EXPORT.ask(plan, train, scenes, held_out, licences)
    (exported,) = _made(runner, EXPORT, [export])
    assert trained is not None, "a stage of one task has it done, or raises"
    assert exported is not None, "a stage of one task has it done, or raises"
    return Bundle(plan.name, export, train, exported, trained.history)


def evaluate_views(
    plan: Plan, runner: Runner, views: Sequence[LabelledView], bundle: Source | None, export: Task | None
) -> tuple[EvaluatedView, ...]:
    """Render and measure views with the baselines, the oracle and a bundle.

    Args:
        plan: What was asked for.
        runner: Does it.
        views: Labelled views.
        bundle: The bundle; None: the others alone.
        export: The task that exported it; None: it is published.
    """
    # Baseline and bundle of a view follow each other: they share the frame's opaque and gather passes.
    asked = [
        [EVALUATE.ask(plan, view, "baseline")]
        + ([] if bundle is None else [EVALUATE.ask(plan, view, "bundle", bundle, export)])
        for view in views
    ]
    made = iter(_made(runner, EVALUATE, [task for tasks in asked for task in tasks]))
    evaluated = []
    for view, tasks in zip(views, asked, strict=True):
        facts = [next(made) for _ in tasks]
        if all(found is not None for found in facts):
            measured = tuple(m for found in facts for m in _measurements(view, found))
            evaluated.append(EvaluatedView(view, tuple(tasks), measured))
    return tuple(evaluated)


def measure_rival(plan: Plan, runner: Runner, views: Sequence[EvaluatedView], rival: Source) -> tuple[Measurement, ...]:
    """A published version on the views that a new one was measured on."""
    asked = [EVALUATE.ask(plan, view.labelled, "bundle", rival) for view in views]
    made = _made(runner, EVALUATE, asked)
    return tuple(m for view, facts in zip(views, made, strict=True) for m in _measurements(view.labelled, facts))


def _made(runner: Runner, stage: Stage[P, F], asked: Sequence[Task]) -> list[F | None]:
    """The facts of each artifact, None for a task that failed; nothing made at all is no answer.

    Raises:
        Problem: Every task of the stage failed.
    """
    made = runner.map(stage.name, asked)
    if asked and all(facts is None for facts in made):
        raise Problem(
            f"The stage {stage.name} failed for {'each of its ' if len(asked) > 1 else 'its '}{len(asked)} "
            f"task{'s' if len(asked) > 1 else ''}.",
            "See the reasons in the tasks of the job; a retry continues from what was made.",
            ExitCode.CHECK_FAILED,
        )
    return [None if facts is None else stage.facts.model_validate(facts) for facts in made]


def _measurements(view: LabelledView, facts: EvaluateFacts | None) -> list[Measurement]:
    measured = () if facts is None else facts.measurements
    about = {"scene": view.scene.label, "camera": view.rendered.view}
    return [record.model_copy(update=about) for record in measured]


def _entry(scene: PlannedScene, facts: SceneFacts) -> SceneEntry:
    licence = facts.licence if scene.licence is None else scene.licence
    return SceneEntry(scene.label, scene.source, scene.held_out, facts, licence)


def _certificates(plan: Plan, view: RenderedView, facts: LabelFacts) -> tuple[Certificate, ...]:
    return tuple(
        Certificate(
            scene=view.scene.label,
            view=view.view.name,
            budget_factor=factor,
            rules={rule: errors[index] for rule, errors in facts.errors.items() if rule != "optimal"},
            **facts.certificates[index].model_dump(),
        )
        for index, factor in enumerate(plan.factors)
    )


def _refuse_copies(entries: Sequence[SceneEntry]) -> None:
    """The split is by asset: a copy of a training scene under another name would prove nothing."""
    seen: dict[tuple[str, int], str] = {}
    for entry in entries:
        # The digest of a scene holds its file names; the root file and what comes of it do not depend on them.
        content = entry.facts.content, entry.facts.triangles
        if content in seen:
            raise Problem(f"{seen[content]} and {entry.label} have the same content.", "Name each scene once.")
        seen[content] = entry.label


def _transparent(runner: Runner, entries: Sequence[SceneEntry]) -> tuple[SceneEntry, ...]:
    """The scenes that have something transparent; an opaque one among them is left out, and that is said.

    Raises:
        Problem: None is left, or none to train on.
    """
    opaque = [entry for entry in entries if entry.facts.opaque]
    kept = [entry for entry in entries if not entry.facts.opaque]
    if opaque:
        why = f"Nothing in {_names(opaque)} is transparent, so there is nothing to allocate."
        remedy = "Make every surface of all scenes transparent with --alpha 0.33, or name other scenes."
        if _nothing_to_learn(entries, kept):
            raise Problem(why, remedy)
        runner.progress.skipped(OPAQUE_SCENES, len(opaque))
        runner.progress.note(f"{why} Left out{_unscored(entries, kept)}. {remedy}")
    return tuple(kept)


def _require_views(runner: Runner, scenes: Sequence[SceneEntry], views: Sequence[RenderedView]) -> None:
    """Says that a scene takes no part because none of its views shows anything transparent.

    Raises:
        Problem: None is left, or none to train on.
    """
    seen = {view.scene.label for view in views}
    kept = [scene for scene in scenes if scene.label in seen]
    unseen = [scene for scene in scenes if scene.label not in seen]
    if not unseen:
        return
    why = f"No view of {_names(unseen)} shows a transparent surface"
    remedy = "Give views with --views, choose --holdout otherwise, or add scenes."
    if _nothing_to_learn(scenes, kept):
        raise Problem(f"{why}, so there is nothing to train on.", remedy, ExitCode.CHECK_FAILED)
    runner.progress.note(f"{why}. Left out{_unscored(scenes, kept)}. {remedy}")


def _nothing_to_learn(asked: Sequence[SceneEntry], kept: Sequence[SceneEntry]) -> bool:
    """Whether none is left of all scenes, or of those to train on."""
    return not kept or (all(scene.held_out for scene in kept) and not all(scene.held_out for scene in asked))


def _unscored(asked: Sequence[SceneEntry], kept: Sequence[SceneEntry]) -> str:
    """What it means if no held-out scene is left."""
    lost = any(scene.held_out for scene in asked) and not any(scene.held_out for scene in kept)
    return ", and no scene remains that was held out: nothing is scored" if lost else ""


def _names(scenes: Sequence[SceneEntry]) -> str:
    return ", ".join(scene.label for scene in scenes)
