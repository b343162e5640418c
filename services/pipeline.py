"""The main job: the only place that knows the order of the stages."""

from __future__ import annotations

import shlex
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from renderer.context import describe, gl_context
from schemas.measurement import Measurement, ReportData, SceneSummary
from schemas.problem import ExitCode, Problem
from services import summary
from services.options import BuildOptions
from services.progress import Progress
from services.registry import bundle_digest
from services.report import Picture, PictureSet, write_report
from services.result import BuildResult
from services.stages.evaluate import EvaluatedView, evaluate_views
from services.stages.label import LabelledView, label_views
from services.stages.learn import Bundle, learn
from services.stages.pictures import EXACT, read_png, stem
from services.stages.publish import publish
from services.stages.render import render_views
from services.stages.scenes import inspect_scenes
from services.stages.workspace import SceneEntry, Workspace
from services.store import Store
from services.versions import library_versions, machine

SHOWN_VIEWS = 2
"""Views of each held-out scene whose pictures go into the report: more would make the file unwieldy."""


def build(options: BuildOptions, progress: Progress) -> BuildResult:
    """From USD scenes to a published bundle and a report. What exists already is not made again.

    Args:
        options: What to build.
        progress: Where progress goes.

    Raises:
        Problem: Bad input, no GL driver, or a check that does not hold.
    """
    started = time.monotonic()
    work = Workspace(options, Store(options.state / "store"), progress)
    scenes = inspect_scenes(work)
    views = label_views(work, render_views(work, scenes))
    _require_views(scenes, views)
    _note_exact_budgets(work, views)
    bundle = learn(work, scenes, views)
    judged = [view for view in views if view.scene.held_out] or list(views)
    evaluated = evaluate_views(work, judged, bundle.folder, bundle_digest(bundle.folder))

    def measure(folder: Path, digest: str) -> list[Measurement]:
        return [m for view in evaluate_views(work, judged, folder, digest, ("bundle",)) for m in view.measurements]

    registered = publish(work, bundle.folder, evaluated, measure)
    data = ReportData(
        name=options.name,
        command=command_line(options),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        scenes=tuple(_scene_summary(scene, views) for scene in scenes),
        measurements=tuple(m for view in evaluated for m in view.measurements),
        certificates=tuple(c for view in judged for c in view.certificates),
        training=bundle.history,
        registry=registered,
        skipped=dict(progress.skips),
        machine={**machine(), "GL": describe(gl_context())} if work.worked else machine(),
        versions=library_versions(),
        provenance=_provenance(options, scenes, bundle),
    )
    report = options.state / "reports" / options.name / "index.html"
    if work.worked or not report.is_file():
        with progress.stage("report", 1) as stage:
            write_report(report, data, _pictures(work, evaluated))
            stage.advance(1)
    return BuildResult(
        report=report,
        registry=registered,
        held_out=tuple(scene.label for scene in scenes if scene.held_out),
        measurements=data.measurements,
        skipped=dict(progress.skips),
        worked=work.worked,
        seconds=time.monotonic() - started,
    )


def command_line(options: BuildOptions) -> str:
    """The command that asks for this build again."""
    parts = ["diaphane", "build", *map(str, options.scenes)]
    parts += ["--budgets", ",".join(f"{budget:g}" for budget in options.budgets)]
    parts += ["--name", options.name, "--size", f"{options.width}x{options.height}"]
    parts += ["--alpha", f"{options.alpha:g}"] if options.alpha is not None else []
    for scene in options.holdout:
        parts += ["--holdout", str(scene)]
    parts += ["--views", str(options.views)] if options.views is not None else []
    parts += ["--views-per-scene", str(options.views_per_scene), "--tail", options.tail, "--g", f"{options.g:g}"]
    parts += ["--seed", str(options.seed)]
    parts += ["--steps", str(options.steps)] if options.steps is not None else []
    return shlex.join(parts)


def _require_views(scenes: Sequence[SceneEntry], views: Sequence[LabelledView]) -> None:
    seen = {view.scene.held_out for view in views}
    for held_out, purpose in ((False, "train on"), (True, "evaluate on")):
        names = ", ".join(scene.label for scene in scenes if scene.held_out == held_out)
        if names and held_out not in seen:
            raise Problem(
                f"No view of {names} shows a transparent surface, so there is nothing to {purpose}.",
                "Give views with --views, choose --holdout otherwise, or add scenes.",
                ExitCode.CHECK_FAILED,
            )


def _note_exact_budgets(work: Workspace, views: Sequence[LabelledView]) -> None:
    for factor, fragments in zip(work.options.budgets, work.budgets, strict=True):
        exact = sum(fragments >= view.rendered.total for view in views)
        if exact:
            work.progress.skipped(f"views that a budget of {factor:g} holds completely: exact without predictor", exact)


def _scene_summary(scene: SceneEntry, views: Sequence[LabelledView]) -> SceneSummary:
    own = [view.rendered for view in views if view.scene.label == scene.label]
    return SceneSummary(
        label=scene.label,
        held_out=scene.held_out,
        views=len(scene.views),
        triangles=scene.triangles,
        fragments=sum(view.total for view in own),
        warnings=scene.warnings,
    )


def _provenance(options: BuildOptions, scenes: Sequence[SceneEntry], bundle: Bundle) -> dict[str, object]:
    return {
        "seed": options.seed,
        "tail": options.tail,
        "g": options.g,
        "alpha": options.alpha,
        "bundle": bundle_digest(bundle.folder),
        "scenes": {scene.label: scene.digest for scene in scenes},
    }


def _pictures(work: Workspace, evaluated: Sequence[EvaluatedView]) -> Iterator[PictureSet]:
    """The first views of each scene, at the middle one of the budgets that are not exact there."""
    shown: dict[str, int] = {}
    for view in evaluated:
        label = view.labelled.scene.label
        budgets = sorted({m.budget_factor for m in summary.compared(view.measurements)})
        if not budgets or shown.get(label, 0) >= SHOWN_VIEWS:
            continue
        shown[label] = shown.get(label, 0) + 1
        yield _picture_set(view, budgets[len(budgets) // 2])


def _picture_set(view: EvaluatedView, factor: float) -> PictureSet:
    techniques = {}
    for m in summary.compared(view.measurements):
        if m.budget_factor != factor:
            continue
        base = view.folders[m.technique] / stem(m.technique, factor)
        techniques[m.technique] = Picture(
            image=read_png(base.with_name(base.name + ".png")),
            flip=read_png(base.with_name(base.name + ".flip.png")).astype(np.float32) / np.float32(255.0),
            k=read_png(base.with_name(base.name + ".k.png")),
        )
    return PictureSet(
        scene=view.labelled.scene.label,
        view=view.labelled.rendered.view.name,
        budget_factor=factor,
        exact=read_png(view.folders["sbuffer"] / EXACT),
        techniques=techniques,
    )
