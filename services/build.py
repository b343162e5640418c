"""A build on this machine, without a server: the pipeline, done in this process, and its report."""

from __future__ import annotations

import shlex
import time
from datetime import UTC, datetime
from pathlib import Path

from schemas.bundle import load_manifest
from schemas.glass import DEFAULT_GLASS
from schemas.licence import verdict
from schemas.network import DEFAULT_NETWORK
from schemas.pixel_weights import DEFAULT_WEIGHTS
from services import pipeline
from services.inline import InlineRunner
from services.local import open_local
from services.local_datasets import write_dataset
from services.measured import Measured
from services.options import BuildOptions
from services.pipeline import Built
from services.plan import plan_of_build
from services.progress import Progress
from services.replay import fine_tuning
from services.result import BuildResult
from services.stages.desk import PAGE
from services.stages.report import Evaluation, write


def build(options: BuildOptions, progress: Progress) -> BuildResult:
    """From USD scenes to a data set, a published bundle and a report. What exists already is not made again.

    Args:
        options: What to build.
        progress: Where progress goes.

    Raises:
        Problem: Bad input, no GL driver, or a check that does not hold.
    """
    started = time.monotonic()
    with open_local(options.state) as local:
        runner = InlineRunner(local.storage, local.registry, Measured(local.database), progress)
        plan, replay = fine_tuning(plan_of_build(options), options, local.registry, progress)
        for path, scene in zip(options.scenes, plan.scenes, strict=True):
            if options.views is not None and not scene.listed:
                progress.note(f"{options.views} has no views of {path}: its own cameras or sampled views are used.")
        built = pipeline.build(plan, runner)
        dataset = options.state / "datasets" / options.name
        write_dataset(dataset, built.views, runner.store, replay)
        provenance = load_manifest(Path(built.registered.folder)).provenance
        report = options.state / "reports" / options.name / PAGE
        if runner.worked or not report.is_file():
            with progress.stage("report", 1) as stage:
                _write_report(report, options, built, runner)
                stage.advance(1)
    return BuildResult(
        report=report,
        dataset=dataset,
        registry=built.registered,
        licences=verdict(provenance.scenes, provenance.licences),
        held_out=tuple(scene.label for scene in built.scenes if scene.held_out),
        measurements=tuple(m for view in built.evaluated for m in view.measurements),
        skipped=dict(progress.skips),
        worked=runner.worked,
        seconds=time.monotonic() - started,
    )


def _write_report(path: Path, options: BuildOptions, built: Built, runner: InlineRunner) -> None:
    created = datetime.now(UTC).isoformat(timespec="seconds")
    data = pipeline.report_data(built, command_line(options), created, runner.progress.skips)
    shown = [
        Evaluation(view.labelled.scene.label, runner.store.path(task.address))
        for view in built.evaluated
        for task in view.tasks
    ]
    write(path, data, shown)


def command_line(options: BuildOptions) -> str:
    """The command that asks for this build again."""
    parts = ["diaphane", "build", *map(str, options.scenes)]
    if options.budgets is not None:
        parts += ["--budgets", ",".join(f"{budget:g}" for budget in options.budgets)]
    parts += ["--name", options.name, "--size", f"{options.width}x{options.height}"]
    parts += ["--alpha", f"{options.alpha:g}"] if options.alpha is not None else []
    parts += ["--glass", options.glass] if options.glass != DEFAULT_GLASS else []
    for scene in options.holdout:
        parts += ["--holdout", str(scene)]
    for scene, licence in options.licences.items():
        parts += ["--licence", f"{scene}={licence}"]
    parts += ["--views", str(options.views)] if options.views is not None else []
    parts += ["--views-per-scene", str(options.views_per_scene), "--tail", options.tail, "--g", f"{options.g:g}"]
    parts += ["--seed", str(options.seed)]
    parts += ["--steps", str(options.steps)] if options.steps is not None else []
    parts += ["--network", options.network] if options.network != DEFAULT_NETWORK else []
    parts += ["--patience", str(options.patience)] if options.patience else []
    parts += ["--weights", options.weights] if options.weights != DEFAULT_WEIGHTS else []
    parts += ["--from", options.start] if options.start is not None else []
    parts += ["--replay", str(options.replay)] if options.replay is not None else []
    return shlex.join(parts)
