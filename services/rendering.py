"""Pictures of local scenes by any technique, and what each cost: the work of `diaphane render`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer import metrics
from renderer.exact_bytes import exact_bytes, fits
from renderer.exr import camera_attributes, write_exr
from renderer.exr_header import Attribute
from renderer.frame import Frame
from renderer.hidden import hidden_fragments
from renderer.scene import NothingToDraw
from renderer.techniques import TECHNIQUES, Budget, KBufferDeep, Rendered, SBuffer, Technique, technique
from renderer.techniques.skips import HIDDEN_FRAGMENTS
from renderer.timecodes import numbered
from schemas.colour import display8
from schemas.problem import ExitCode, Problem
from services.local_scenes import Chosen, LocalScene, as_usd
from services.options import ChosenTail, check_budget, check_trained_tail, chosen_tail
from services.progress import Progress
from services.render_options import RenderOptions
from services.scene_warnings import said_warnings
from services.stages.pictures import write_png
from services.writing import replacing

_WARM_SIZE = (64, 48)
"""Drivers compile shaders at their first use: what is timed is not the first."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that was written, and what it cost; numbers are None where there is no picture.

    Attributes:
        file: Path.
        scene: File of the scene.
        view: Name of the view.
        view_how: Why it is this one.
        frame: Time code; None: the default time.
        technique: Name.
        family: `exact`, `bounded` or `approximate`.
        width: Pixels per row.
        height: Rows.
        budget: F, fragments.
        tail: Of the bounded techniques.
        fragments: N.
        captured: Fragments that were kept apart.
        k: Least and greatest k of a pixel that has fragments.
        passes: Milliseconds of each pass.
        pool_bytes: Storage that grows with fragments or slots.
        pixel_bytes: All other buffers beside it, bytes a pixel.
        total_bytes: Peak of the frame. Of an exact technique also where there is no picture: what it would need.
        fits: Whether the pool fits one storage buffer; a larger one is rendered in bands of rows, or not at all.
        skips: What was not needed -> how often.
        mse: Against the exact picture, 8-bit sRGB, values in [0,1]; None if it was not compared.
        psnr: dB; None also for no error.
        flip: Mean LDR-FLIP.
        problem: Why there is no picture.
        warnings: What of the scene is not supported or missing.
    """

    file: Path
    scene: Path
    view: str
    view_how: str
    frame: float | None
    technique: str
    family: str
    width: int
    height: int
    budget: int
    tail: str
    fragments: int | None = None
    captured: int | None = None
    k: tuple[int, int] | None = None
    passes: dict[str, float] | None = None
    pool_bytes: int | None = None
    pixel_bytes: int | None = None
    total_bytes: int | None = None
    fits: bool = True
    skips: dict[str, int] | None = None
    mse: float | None = None
    psnr: float | None = None
    flip: float | None = None
    problem: str | None = None
    warnings: tuple[str, ...] = ()

    def json(self) -> dict[str, Any]:
        """Of plain values only."""
        total = None if self.passes is None else sum(self.passes.values())
        return {**asdict(self), "file": str(self.file), "scene": str(self.scene), "total_ms": total}


@dataclass(frozen=True, slots=True)
class _Job:
    """One picture to make.

    Attributes:
        scene: Loaded at its frame.
        chosen: The view.
        frame: Time code, or None for the default time.
        size: Width and height.
        tail: Of the bounded techniques.
    """

    scene: LocalScene
    chosen: Chosen
    frame: float | None
    size: tuple[int, int]
    tail: ChosenTail


def render(options: RenderOptions, progress: Progress) -> Iterator[Picture]:
    """Every scene, frame, view and technique, one after the other; each picture is on disk when it is given.

    Raises:
        Problem: A scene cannot be loaded, or the only technique asked for cannot render it.
    """
    with bundle_folder(options.bundle, options.state) as bundle:
        needs = replace(options.needs, bundle=bundle, allocate=optimal)
        techniques = [technique(name, needs) for name in options.techniques]
        trained = next((each.manifest.tail for each in techniques if isinstance(each, KBufferDeep)), None)
        check_trained_tail(options.tail, trained)
        tail = chosen_tail(options.tail, options.g, trained)
        written: set[Path] = set()
        for file in options.scenes:
            with as_usd(file) as usd:
                scene = LocalScene(file, usd, options.load)
                yield from _scene(scene, techniques, tail, options, progress, written)


def _scene(
    scene: LocalScene,
    techniques: list[Technique],
    tail: ChosenTail,
    options: RenderOptions,
    progress: Progress,
    written: set[Path],
) -> Iterator[Picture]:
    warm: set[str] = set()
    told: set[str] = set()
    left_out: list[Problem] = []
    for time in options.frames or (None,):
        try:
            warnings = scene.at(time).warnings
        except NothingToDraw as problem:
            left_out.append(problem)
            if len(left_out) >= len(options.frames):
                raise
            progress.note(f"warning: frame {time:g} is left out. {problem.title}")
            continue
        for line in said_warnings(scene.file, [line for line in warnings if line not in told], scene.file):
            progress.note(line)
        told.update(warnings)
        frame = scene.start if time is None else None if math.isnan(time) else time
        for chosen in scene.views(options.camera, options.views):
            job = _Job(scene, chosen, frame, size_of(options, chosen.aspect), tail)
            check_budget(options.budget, "--budget 2", job.size)
            for each in techniques:
                path = path_of(options, job, each.name)
                if path in written:
                    raise Problem(
                        f"More than one picture would be written to {path}.", "Give the scenes different names."
                    )
                written.add(path)
                yield _picture(job, each, path, options, warm)


def _picture(job: _Job, each: Technique, path: Path, options: RenderOptions, warm: set[str]) -> Picture:
    width, height = job.size
    budget = Budget(int(options.budget * width * height), job.tail.name, job.tail.g)
    about = Picture(
        file=path,
        scene=job.scene.file,
        view=job.chosen.view.name,
        view_how=job.chosen.how,
        frame=job.frame,
        technique=each.name,
        family=TECHNIQUES[each.name].family,
        width=width,
        height=height,
        budget=budget.fragments,
        tail=job.tail.name,
        warnings=job.scene.gpu().scene.warnings,
    )
    try:
        if each.name not in warm:
            warm.add(each.name)
            _shoot(job, each, replace(budget, fragments=2 * _WARM_SIZE[0] * _WARM_SIZE[1]), _WARM_SIZE, options)
        frame, rendered = _shoot(job, each, budget, job.size, options)
    except Problem as problem:
        if problem.code != ExitCode.LIMIT or len(options.techniques) == 1:
            raise
        return _unrendered(about, job, options, problem)
    found = _measured(about, rendered, frame)
    if options.compare:
        found = _compared(found, rendered, _shoot(job, SBuffer(), budget, job.size, options)[1])
    _write(found, rendered, job, options)
    return found


def _shoot(
    job: _Job, each: Technique, budget: Budget, size: tuple[int, int], options: RenderOptions
) -> tuple[Frame, Rendered]:
    """A technique on a frame of its own: nothing that another one left there is reused."""
    frame = Frame(job.scene.gpu(), job.chosen.view, *size, options.background)
    return frame, each.render(frame, budget)


def _unrendered(about: Picture, job: _Job, options: RenderOptions, problem: Problem) -> Picture:
    """Why there is no picture, and the bytes that an exact technique would need for one."""
    found = replace(about, problem=problem.title)
    if about.family != "exact":
        return found
    n = Frame(job.scene.gpu(), job.chosen.view, *job.size, options.background).count()
    needed = exact_bytes(about.technique, n)
    assert needed is not None, "every exact technique says what it needs"
    return replace(
        found,
        fragments=int(n.sum(dtype=np.int64)),
        pool_bytes=needed.pool,
        pixel_bytes=needed.pixel,
        total_bytes=needed.total,
        fits=fits(needed.pool),
    )


def _measured(about: Picture, rendered: Rendered, frame: Frame) -> Picture:
    n = frame.count()
    k = rendered.k[n > 0]
    skips = {**rendered.skips, HIDDEN_FRAGMENTS: hidden_fragments(frame)}
    return replace(
        about,
        fragments=int(n.sum(dtype=np.int64)),
        captured=rendered.captured,
        k=(int(k.min(initial=np.iinfo(np.int32).max)), int(k.max())) if len(k) else (0, 0),
        passes=dict(rendered.passes),
        pool_bytes=rendered.pool_bytes,
        pixel_bytes=rendered.pixel_bytes,
        total_bytes=rendered.total_bytes,
        fits=fits(rendered.pool_bytes),
        skips={what: count for what, count in skips.items() if count},
    )


def _compared(found: Picture, rendered: Rendered, exact: Rendered) -> Picture:
    test, reference = display8(rendered.linear), display8(exact.linear)
    error = metrics.mse(test, reference)
    psnr = None if error == 0.0 else metrics.psnr(error)
    return replace(found, mse=error, psnr=psnr, flip=metrics.flip(test, reference)[0])


def _write(found: Picture, rendered: Rendered, job: _Job, options: RenderOptions) -> None:
    if found.file.suffix.lower() == ".png":
        with replacing(found.file) as path:
            write_png(path, display8(rendered.linear))
        return
    passes = found.passes or {}
    attributes: dict[str, Attribute] = {
        "software": "diaphane",
        "technique": found.technique,
        "fragments": str(found.fragments),
        "milliseconds": ", ".join(f"{name} {ms:.3f}" for name, ms in passes.items()),
        "poolBytes": str(found.pool_bytes),
        "totalBytes": str(found.total_bytes),
    }
    if found.family == "bounded":
        attributes |= {"budget": str(found.budget), "tail": job.tail.name, "g": job.tail.g}
    scene = job.scene.gpu().scene
    attributes |= camera_attributes(job.chosen.view, scene, found.width, found.height)
    with replacing(found.file) as path:
        write_exr(path, rendered.linear, attributes, options.is_full)


def size_of(options: RenderOptions, aspect: float) -> tuple[int, int]:
    """Width and height of a picture, as `usdrecord` rounds it."""
    return options.size or (options.image_width, max(1, int(options.image_width / aspect)))


def path_of(options: RenderOptions, job: _Job, name: str) -> Path:
    """Where a picture goes: the output, with what tells it from the others behind the first part of its name."""
    number = "" if len(options.frames) < 2 else ".####"
    pattern = options.output or Path(f"{job.scene.file.stem}{number}.png")
    labels = []
    if options.output is not None and len(options.scenes) > 1:
        labels.append(job.scene.file.stem)
    if options.views is not None:
        labels.append(job.chosen.view.name)
    if len(options.techniques) > 1:
        labels.append(name)
    head, dot, rest = pattern.name.partition(".")
    return numbered(pattern.with_name("-".join((head, *labels)) + dot + rest), job.frame or 0.0)


def optimal(frame: Frame, budget: Budget) -> NDArray[np.int32]:
    """The certified optimum for a frame, int32 [P]; see `renderer.techniques.kbuffer_optimal.Allocate`."""
    from labeller.curves import error_curves
    from labeller.rules import allocate_curves
    from renderer.capture import capture

    dump = capture(frame).dump
    curves = error_curves(dump, budget.tail, budget.g, "display")
    return allocate_curves(dump, curves, [budget.fragments], "optimal")[0].k


@contextmanager
def bundle_folder(bundle: str | None, state: Path) -> Iterator[Path | None]:
    """Folder of the bundle that was asked for: one on disk, or one of the registry; None if none was.

    Args:
        bundle: A folder, or NAME@ALIAS.
        state: Folder of the registry.
    """
    if bundle is None or Path(bundle).is_dir():
        yield None if bundle is None else Path(bundle)
        return
    from services.local import open_local

    with open_local(state) as local:
        yield local.registry.folder(local.registry.resolve(bundle))
