"""A build on this machine, without a server: the pipeline, done in this process, and its report."""

from __future__ import annotations

import shlex
import time
from datetime import UTC, datetime
from pathlib import Path

from diaphane.local.datasets import write_dataset
from diaphane.local.inline import InlineRunner
from diaphane.local.options import BuildOptions
from diaphane.local.plan import plan_of_build
from diaphane.local.replay import fine_tuning
from diaphane.local.result import BuildResult
from diaphane.local.state import open_local
from evaluation.progress import Progress
from schemas.bundle import load_manifest
from schemas.flags import written
from schemas.licence import verdict
from services import pipeline
from services.installed import require
from services.measured import Measured
from services.pipeline import Built
from stages.desk import PAGE
from stages.making.report import Evaluation, write


def build(options: BuildOptions, progress: Progress) -> BuildResult:
    """From USD scenes to a data set, a published bundle and a report. What exists already is not made again.

    Args:
        options: What to build.
        progress: Where progress goes.

    Raises:
        Problem: Bad input, no GL driver, a package that is not installed, or a check that does not hold.
    """
    require("render", "label", "train")
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


def command_line(asked: BuildOptions) -> str:
    """The command that asks for this build again."""
    parts = ["diaphane", "build", *map(str, asked.scenes), "--name", asked.name]
    for scene in asked.holdout:
        parts += ["--holdout", str(scene)]
    for scene, licence in asked.licences.items():
        parts += ["--licence", f"{scene}={licence}"]
    parts += ["--views", str(asked.views)] if asked.views is not None else []
    parts += ["--from", asked.start] if asked.start is not None else []
    parts += ["--replay", str(asked.replay)] if asked.replay is not None else []
    return shlex.join([*parts, *written(asked.options)])
