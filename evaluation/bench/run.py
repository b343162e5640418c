"""A whole benchmark: scenes, opacities, sizes and views one after the other, results appended view by view."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.bench.album import Album
from evaluation.bench.cells import Bundle, bundle_of, planned
from evaluation.bench.groups import said_alpha
from evaluation.bench.kept import Kept
from evaluation.bench.measure import Bench, without_pictures
from evaluation.bench.options import BenchOptions
from evaluation.bench.subject import Subject
from evaluation.budget_words import holds_all, remedy, said_complete, said_defaults
from evaluation.local_scenes import LocalScene, as_usd
from evaluation.progress import Progress
from evaluation.scene_warnings import said_warnings
from evaluation.versions import code_version, commit, library_versions, machine
from labeller.budgets import default_budgets
from renderer.context import describe, gl_context
from renderer.scene import LoadOptions
from renderer.timing import shared_clock, timers_are_right
from renderer.usd.digest import scene_digest
from schemas.bench import BenchCell, BenchResult, BenchView, CellKey, Yardstick
from schemas.canonical import canonical_json
from schemas.glass import DEFAULT_GLASS
from schemas.problem import ExitCode, Problem
from schemas.scene import SceneArrays
from schemas.view import View
from schemas.work import Device

DEVICE = Device()
"""What bounds are stated for where nothing else is asked for."""
MEASURED_BY = ("labeller", "renderer", "schemas", "evaluation.bench")
"""Sources that decide a result."""

Told = Callable[[BenchView], None]
"""Is told of each view that was measured."""


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a view is seen: all that its key is made of."""

    file: Path
    digest: str
    alpha: float | None
    size: tuple[int, int]
    view: View


def bench(
    options: BenchOptions, folder: Path | None, command: str, progress: Progress, told: Told = lambda _: None
) -> BenchResult:
    """Measure what is not measured yet, and give all results of the folder.

    Args:
        options: What to measure.
        folder: Of the bundle of the options; None: they name none.
        command: How it was asked for.
        progress: Gets notes.
        told: Is called with each view when it is on the disk.

    Raises:
        Problem: A scene cannot be read, or the bundle is none.
    """
    kept = Kept(options.out, options.resume)
    left_out: list[str] = []
    bundle = None if folder is None else bundle_of(folder)
    for file in options.scenes:
        warned: set[str] = set()
        with as_usd(file) as usd:
            for alpha in options.alphas:
                local = _loaded(options, alpha, file, usd)
                _warn(file, local.now.scene.warnings, warned, progress)
                if local.now.scene.is_opaque:
                    left_out.append(f"{file}, {said_alpha(alpha)}: nothing in it is transparent.")
                    progress.note(left_out[-1])
                    continue
                places = _places(options, alpha, file, usd, local)
                asked = _with_budgets(options, places, local, progress)
                for place in places:
                    subject = Subject(local.gpu(), place.view, place.size)
                    _measure(place, subject, asked, bundle, kept, progress, told)
    label = None if bundle is None else bundle.label
    return result_of(kept, command, label, left_out, options.device)


def result_of(
    kept: Kept, command: str, bundle: str | None, left_out: Sequence[str] = (), device: Device = DEVICE
) -> BenchResult:
    """All results of a folder, but for those of other bundles.

    Args:
        kept: The folder.
        command: How it was asked for.
        bundle: Label of the bundle, or None.
        left_out: What could not be measured.
        device: What bounds of frame times are stated for.
    """
    views = []
    for view in kept.merged():
        cells = tuple(cell for cell in view.cells if cell.bundle in (None, bundle))
        views.append(view.model_copy(update={"cells": cells}))
    return BenchResult(
        command=command,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        versions=library_versions(),
        bundle=bundle,
        device=device,
        left_out=tuple(left_out),
        views=tuple(views),
    )


def _loaded(options: BenchOptions, alpha: float | None, file: Path, usd: Path) -> LocalScene:
    load = LoadOptions(alpha=alpha, glass=options.glass, variants=options.variants, refine=options.refine)
    local = LocalScene(file, usd, load)
    local.at(None)
    return local


def _warn(file: Path, warnings: Sequence[str], warned: set[str], progress: Progress) -> None:
    """Tells what was not told of the file at another opacity."""
    for line in said_warnings(file, [text for text in warnings if text not in warned], file):
        progress.note(line)
    warned.update(warnings)


def _places(options: BenchOptions, alpha: float | None, file: Path, usd: Path, local: LocalScene) -> list[_Place]:
    """The views of a scene with an opacity, at all sizes."""
    digest = scene_digest(usd)
    return [_Place(file, digest, alpha, size, view) for view in _views(local, options) for size in options.sizes]


def _with_budgets(
    options: BenchOptions, places: Sequence[_Place], local: LocalScene, progress: Progress
) -> BenchOptions:
    """The options with their budgets: those of a scene with an opacity are the same at all of its views and sizes."""
    loads = [_load(place, local) for place in places]
    if options.budgets is None:
        options = replace(options, budgets=default_budgets(loads))
        progress.note(f"{_title(places[0])}: {said_defaults(options.factors, loads)}")
    if holds_all(options.factors, loads):
        told = f"{said_complete(options.factors, loads)} {remedy(loads)}"
        progress.note(f"{_title(places[0])}: {told}")
    return options


def _load(place: _Place, local: LocalScene) -> float:
    """N / (W H) of a view."""
    counts = Subject(local.gpu(), place.view, place.size).frame().count()
    return int(counts.sum(dtype=np.int64)) / len(counts)


def _title(place: _Place) -> str:
    return f"{place.file.stem}, {said_alpha(place.alpha)}"


def _views(local: LocalScene, options: BenchOptions) -> list[View]:
    views = [chosen.view for chosen in local.views(options.camera, options.views)]
    most = options.most_views or len(views)
    return views[:: max(1, len(views) // most)][:most]


def _measure(
    place: _Place,
    subject: Subject,
    options: BenchOptions,
    bundle: Bundle | None,
    kept: Kept,
    progress: Progress,
    told: Told,
) -> None:
    key = _key(place, options)
    missing = kept.missing(key, planned(options, bundle))
    where = f"{_title(place)}, {place.size[0]}x{place.size[1]}, {place.view.name}"
    if not missing:
        progress.note(f"{where}: measured already")
        return
    load, start = os.getloadavg()[0], time.perf_counter()
    marks, cells, n = _measured(subject, options, bundle, missing, key)
    scene: SceneArrays = subject.gpu.scene
    view = BenchView(
        key=key,
        scene=place.file.stem,
        view=place.view.name,
        alpha=place.alpha,
        width=place.size[0],
        height=place.size[1],
        triangles=len(scene.indices) // 3,
        fragments=int(n.sum(dtype=np.int64)),
        occupied=int((n > 0).sum()),
        most=int(n.max(initial=0)),
        path_frames=options.path,
        yardsticks=tuple(marks),
        cells=tuple(cells),
        driver=describe(gl_context()),
        clock=_clock(),
        machine=machine(),
        commit=commit(),
        code=code_version(*MEASURED_BY),
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        seconds=time.perf_counter() - start,
        load=(load, os.getloadavg()[0]),
    )
    kept.add(view)
    progress.note(f"{where}: {len(cells)} cells in {view.seconds:.0f} s")
    told(view)


def _measured(
    subject: Subject, options: BenchOptions, bundle: Bundle | None, keys: Sequence[CellKey], place: str
) -> tuple[list[Yardstick], list[BenchCell], NDArray[np.integer]]:
    """Yardsticks and cells of a view, and its fragments of each pixel, int [P]."""
    try:
        n = subject.dump.counts
    except Problem as problem:
        if problem.code != ExitCode.LIMIT:
            raise
        counts = subject.frame().count()
        return [], without_pictures(keys, counts, problem), counts
    album = Album(options.out, place, subject.exact8)
    return *Bench(subject, options, bundle, album).measure(keys), n


def _key(place: _Place, options: BenchOptions) -> str:
    """Digest of everything but the cells that decides the result.

    The code does not count: a run that was stopped goes on after a change of a comment, and every line says by which
    code it was measured.
    """
    parts = {
        "scene": place.digest,
        "alpha": place.alpha,
        "size": place.size,
        "view": place.view.model_dump(mode="json"),
        "variants": options.variants,
        "refine": options.refine,
        "needs": {"vkb": asdict(options.needs.vkb), "inference": options.needs.inference},
        "nodes": options.needs.nodes,
        "samples": options.needs.samples,
        "times": (options.repeats, options.limit),
        "path": options.path,
        "driver": describe(gl_context()),
        "clock": _clock(),
        "machine": machine(),
        **({"glass": options.glass} if options.glass != DEFAULT_GLASS else {}),
    }
    return hashlib.sha256(canonical_json(parts).encode()).hexdigest()


def _clock() -> str:
    if shared_clock(gl_context()) is time.process_time:
        return "processor time of all threads, each pass finished before and after"
    host = "host clock, each pass finished before and after"
    if timers_are_right(gl_context()):
        return f"{host}; GPU timer queries beside it"
    return f"{host}; this driver's GPU timer queries are not right"


def check_same_code(result: BenchResult) -> str | None:
    """A sentence if lines were measured by different sources; None if all are of one."""
    codes = {view.code for view in result.views}
    if len(codes) < 2:
        return None
    return f"These results were measured by {len(codes)} versions of the sources; --fresh measures all by one."


def no_views(result: BenchResult) -> Problem:
    """What to say where nothing could be measured."""
    why = " ".join(result.left_out)
    return Problem(f"There is nothing to measure. {why}".strip(), "Give --alpha .33, or a scene.", ExitCode.NOT_FOUND)
