"""Pictures of local scenes by any technique, and what each cost: the work of `diaphane render`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.choices import ChosenTail, check_budget, check_trained_tail, chosen_tail
from evaluation.contact_sheet import ContactSheet
from evaluation.local_scenes import Chosen, LocalScene, as_usd
from evaluation.looks import title
from evaluation.pictures import write_png
from evaluation.progress import Progress
from evaluation.render_options import RenderOptions
from evaluation.scene_warnings import said_warnings
from evaluation.shots import Shot, Subject, shoot
from evaluation.writing import replacing
from renderer import metrics
from renderer.aovs import CHANNELS
from renderer.exact_bytes import exact_bytes, fits
from renderer.exr import camera_attributes, write_exr
from renderer.exr_header import Attribute
from renderer.frame import Frame
from renderer.scene import NothingToDraw
from renderer.techniques import (
    TECHNIQUES,
    Budget,
    KBufferDeep,
    KBufferTemporal,
    Needs,
    SBuffer,
    Technique,
    technique,
)
from renderer.timecodes import numbered
from schemas.colour import display8
from schemas.problem import ExitCode, Problem

SHEET = "sheet"
"""What the name of a contact sheet has in the place of a technique."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture, and what it cost; numbers are None where there is none.

    Attributes:
        file: Where it was written; None: it was only handed over (`take`).
        scene: File of the scene.
        view: Name of the view.
        view_how: Why it is this one.
        frame: Time code; None: the default time.
        technique: Name.
        family: `exact`, `bounded` or `approximate`.
        width: Pixels per row.
        height: Rows.
        samples: Of a pixel. Fragments, the budget, milliseconds and skips are sums over them; bytes are of one frame.
        budget: F, fragments.
        tail: Of the bounded techniques.
        fragments: N.
        captured: Fragments that were kept apart.
        k: Least and greatest k of a pixel that has fragments.
        passes: Milliseconds of each pass.
        pool_bytes: Storage that grows with fragments or slots.
        pixel_bytes: All other buffers beside it, bytes per pixel.
        total_bytes: Peak of the frame. Of an exact technique also where there is no picture: what it would need.
        fits: Whether the pool fits one storage buffer; a larger one is rendered in bands of rows, or not at all.
        skips: What was not needed -> how often.
        mse: Against the exact picture, 8-bit sRGB, values in [0,1]; None if it was not compared.
        psnr: dB; None also for no error.
        flip: Mean LDR-FLIP.
        problem: Why there is no picture.
        warnings: What of the scene is not supported or missing.
        sheet: Contact sheet that it is on, written behind the last picture of its view; None: on none.
    """

    file: Path | None
    scene: Path
    view: str
    view_how: str
    frame: float | None
    technique: str
    family: str
    width: int
    height: int
    samples: int
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
    sheet: Path | None = None

    @property
    def milliseconds(self) -> float | None:
        """Of all passes."""
        return None if self.passes is None else sum(self.passes.values())

    def json(self) -> dict[str, Any]:
        """Of plain values only."""
        paths = {
            "file": None if self.file is None else str(self.file),
            "scene": str(self.scene),
            "sheet": None if self.sheet is None else str(self.sheet),
        }
        return {**asdict(self), **paths, "total_ms": self.milliseconds}


@dataclass(frozen=True, slots=True)
class _Way:
    """A technique, as often as it is needed.

    Attributes:
        name: Of it.
        samples: One for each sample of a pixel: the same, unless it remembers what it saw of its last frame.
        warm: One whose frames are not kept, of which the same holds.
    """

    name: str
    samples: tuple[Technique, ...]
    warm: Technique


@dataclass(frozen=True, slots=True)
class _Job:
    """The pictures of a view.

    Attributes:
        scene: Loaded at its frame.
        chosen: The view.
        frame: Time code, or None for the default time.
        size: Width and height.
        tail: Of the bounded techniques.
        exact: The exact picture, once something has been compared with it.
        sheet: Contact sheet.
    """

    scene: LocalScene
    chosen: Chosen
    frame: float | None
    size: tuple[int, int]
    tail: ChosenTail
    exact: list[Shot]
    sheet: ContactSheet

    def subject(self, options: RenderOptions) -> Subject:
        """What is rendered."""
        return Subject(self.scene.gpu(), self.chosen.view, self.size, options.background, options.samples, options.aovs)

    def budget(self, options: RenderOptions) -> Budget:
        """Of each sample's frame."""
        return Budget(int(options.budget * self.size[0] * self.size[1]), self.tail.name, self.tail.g)


def render(options: RenderOptions, bundle: Path | None, progress: Progress) -> Iterator[Picture]:
    """Every scene, frame, view and technique, one after the other; each picture is on disk when it is given.

    Args:
        options: What is rendered.
        bundle: Folder of the bundle of the options; None: they name none.
        progress: Is told of warnings.

    Raises:
        Problem: A scene cannot be loaded, or the only technique asked for cannot render it.
    """
    ways, tail = _ways(options, bundle)
    written: set[Path] = set()
    for file in options.scenes:
        with as_usd(file) as usd:
            scene = LocalScene(file, usd, options.load)
            yield from _scene(scene, ways, tail, options, progress, written)


def take(scene: LocalScene, options: RenderOptions, bundle: Path | None, warm: set[str]) -> tuple[Picture, Shot]:
    """One picture of a scene that is open, handed over instead of written.

    Args:
        scene: The scene; it is loaded at the time of the picture.
        options: What is rendered: one technique, one camera, at most one frame.
        bundle: Folder of the bundle of the options; None: they name none.
        warm: Techniques that drew this scene before; this one is added.

    Raises:
        Problem: The scene cannot be loaded, or the technique cannot render it.
    """
    (way,), tail = _ways(options, bundle)
    time = next(iter(options.frames), None)
    scene.at(time)
    (chosen,) = scene.views(options.camera, None)
    job = _job(scene, chosen, _frame(scene, time), tail, options)
    shot = _shot(job, way, options, warm)
    return _found(_about(job, way, None, options), shot, job, options), shot


def _ways(options: RenderOptions, bundle: Path | None) -> tuple[list[_Way], ChosenTail]:
    needs = replace(options.needs, bundle=bundle, allocate=optimal)
    ways = [_way(name, needs, options.samples) for name in options.techniques]
    trained = next((way.warm.manifest.tail for way in ways if isinstance(way.warm, KBufferDeep)), None)
    check_trained_tail(options.tail, trained)
    return ways, chosen_tail(options.tail, options.g, trained)


def _way(name: str, needs: Needs, samples: int) -> _Way:
    first = technique(name, needs)
    if isinstance(first, KBufferTemporal):
        return _Way(name, tuple(technique(name, needs) for _ in range(samples)), first)
    return _Way(name, (first,) * samples, first)


def _scene(
    scene: LocalScene,
    ways: list[_Way],
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
            loaded = scene.at(time)
        except NothingToDraw as problem:
            left_out.append(problem)
            if len(left_out) >= len(options.frames):
                raise
            progress.note(f"warning: frame {time:g} is left out. {problem.title}")
            continue
        hint = [said_opaque(options)] if loaded.is_opaque else []
        news = [line for line in (*hint, *loaded.warnings) if line not in told]
        for line in said_warnings(scene.file, news, scene.file):
            progress.note(line)
        told.update(news)
        for chosen in scene.views(options.camera, options.views):
            yield from _view(_job(scene, chosen, _frame(scene, time), tail, options), ways, options, warm, written)


def _frame(scene: LocalScene, time: float | None) -> float | None:
    """Time code of a picture; None: the default time."""
    return scene.start if time is None else None if math.isnan(time) else time


def _job(scene: LocalScene, chosen: Chosen, frame: float | None, tail: ChosenTail, options: RenderOptions) -> _Job:
    size = size_of(options, chosen.aspect)
    check_budget(options.budget, "--budget 2", size)
    return _Job(scene, chosen, frame, size, tail, [], ContactSheet(f"{scene.file.name}, view {chosen.view.name}"))


def said_opaque(options: RenderOptions) -> str:
    """What to do about a scene without anything transparent."""
    if options.load.alpha is not None:
        return "nothing in it is transparent"
    return "nothing in it is transparent: --alpha 0.33 makes every surface so"


def _view(job: _Job, ways: list[_Way], options: RenderOptions, warm: set[str], written: set[Path]) -> Iterator[Picture]:
    sheet = path_of(options, job, SHEET).with_suffix(".png") if options.compare and len(ways) > 1 else None
    paths = {way.name: path_of(options, job, way.name) for way in ways}
    for path in (*paths.values(), *([] if sheet is None else [sheet])):
        if path in written:
            raise Problem(f"More than one picture would be written to {path}.", "Give the scenes different names.")
        written.add(path)
    for way in ways:
        yield replace(_picture(job, way, paths[way.name], options, warm), sheet=sheet)
    if sheet is not None and job.sheet.cells:
        with replacing(sheet) as path:
            write_png(path, job.sheet.image())


def _picture(job: _Job, way: _Way, path: Path, options: RenderOptions, warm: set[str]) -> Picture:
    about = _about(job, way, path, options)
    try:
        shot = _shot(job, way, options, warm)
    except Problem as problem:
        if problem.code != ExitCode.LIMIT or len(options.techniques) == 1:
            raise
        return _unrendered(about, job, options, problem)
    found = _found(about, shot, job, options)
    _write(path, found, shot, job, options)
    return found


def _about(job: _Job, way: _Way, path: Path | None, options: RenderOptions) -> Picture:
    """What is known of a picture before it is rendered."""
    width, height = job.size
    return Picture(
        file=path,
        scene=job.scene.file,
        view=job.chosen.view.name,
        view_how=job.chosen.how,
        frame=job.frame,
        technique=way.name,
        family=TECHNIQUES[way.name].family,
        width=width,
        height=height,
        samples=options.samples,
        budget=options.samples * job.budget(options).fragments,
        tail=job.tail.name,
        warnings=job.scene.gpu().scene.warnings,
    )


def _shot(job: _Job, way: _Way, options: RenderOptions, warm: set[str]) -> Shot:
    subject, budget = job.subject(options), job.budget(options)
    if way.name not in warm:
        # Drivers compile, allocate and place memory at its first use: what is timed is not the first frame.
        warm.add(way.name)
        shoot(replace(subject, samples=1, aovs=()), (way.warm,), budget)
    return shoot(subject, way.samples, budget)


def _found(about: Picture, shot: Shot, job: _Job, options: RenderOptions) -> Picture:
    """What is known of a picture once it is rendered."""
    found = _measured(about, shot)
    return _compared(found, shot, job, options) if options.compare else found


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


def _measured(about: Picture, shot: Shot) -> Picture:
    return replace(
        about,
        fragments=shot.fragments,
        captured=shot.captured,
        k=shot.k,
        passes=dict(shot.passes),
        pool_bytes=shot.pool_bytes,
        pixel_bytes=shot.pixel_bytes,
        total_bytes=shot.total_bytes,
        fits=fits(shot.pool_bytes),
        skips=dict(shot.skips),
    )


def _compared(found: Picture, shot: Shot, job: _Job, options: RenderOptions) -> Picture:
    """With its errors against the exact picture of as many samples; it is on the contact sheet then."""
    if not job.exact:
        subject = replace(job.subject(options), aovs=())
        job.exact.append(shoot(subject, (SBuffer(),) * options.samples, Budget(found.budget)))
    test, reference = display8(shot.linear), display8(job.exact[0].linear)
    error = metrics.mse(test, reference)
    psnr = None if error == 0.0 else metrics.psnr(error)
    milliseconds = found.milliseconds or 0.0
    caption = f"MSE {1e5 * error:.4g}e-5, {milliseconds:.1f} ms" if error else f"no error, {milliseconds:.1f} ms"
    job.sheet.add(title(found.technique), caption, test, reference, (error, milliseconds))
    return replace(found, mse=error, psnr=psnr, flip=metrics.flip(test, reference)[0])


def _write(file: Path, found: Picture, shot: Shot, job: _Job, options: RenderOptions) -> None:
    if file.suffix.lower() == ".png":
        with replacing(file) as path:
            write_png(path, display8(shot.linear))
        return
    passes = found.passes or {}
    attributes: dict[str, Attribute] = {
        "software": "diaphane",
        "technique": found.technique,
        "samples": str(found.samples),
        "fragments": str(found.fragments),
        "milliseconds": ", ".join(f"{name} {ms:.3f}" for name, ms in passes.items()),
        "poolBytes": str(found.pool_bytes),
        "totalBytes": str(found.total_bytes),
    }
    if found.family == "bounded":
        attributes |= {"budget": str(found.budget), "tail": job.tail.name, "g": job.tail.g}
    scene = job.scene.gpu().scene
    attributes |= camera_attributes(job.chosen.view, scene, found.width, found.height)
    with replacing(file) as path:
        planes = {CHANNELS[name]: plane for name, plane in shot.aovs.items()}
        write_exr(path, shot.linear, attributes, options.is_full, planes)


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
