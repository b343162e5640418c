"""`diaphane view`: opens scene and bundle, then shows them in a window or writes frames."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

from evaluation.choices import check_trained_tail, chosen_tail
from evaluation.progress import Progress
from evaluation.render_options import EVERY, parse_techniques
from evaluation.scene_warnings import said_warnings
from evaluation.viewer import statistics
from evaluation.viewer.comparing import Comparer
from evaluation.viewer.controls import Look, Place
from evaluation.viewer.headless import frames
from evaluation.viewer.layout import across
from evaluation.viewer.model import Service, Source, local_source, remote_source
from evaluation.viewer.options import Opened, ViewerOptions, opened
from evaluation.viewer.session import Session
from evaluation.viewer.statistics import Row
from evaluation.viewer.studio import Studio
from renderer.techniques import TECHNIQUES
from schemas.bundle import load_manifest


def view(options: ViewerOptions, folder: Path | None, service: Service | None, progress: Progress) -> list[Row]:
    """Look at a scene.

    Args:
        options: What, and how.
        folder: Of the bundle of the options; None: they name none, or one of the service.
        service: Where the model is fetched from; None: the bundle is in `folder`.
        progress: Is told of warnings, frames and files.

    Returns:
        The statistics that were written.

    Raises:
        Problem: The scene or the bundle cannot be read, a frame cannot be rendered, or no window be opened.
    """
    if options.csv is not None:
        statistics.check(options.csv)
    asked = options.render
    bundle: AbstractContextManager[Source] = (
        local_source(folder, asked.bundle or "") if service is None else remote_source(service)
    )
    with bundle as source, opened(options) as scene:
        for line in said_warnings(scene.scene.file, scene.scene.now.scene.warnings, scene.scene.file):
            progress.note(line)
        if options.frames is not None:
            return _write_frames(options, options.frames, scene, source, progress)
        return _show(options, scene, source, progress)


def _write_frames(options: ViewerOptions, count: int, scene: Opened, source: Source, progress: Progress) -> list[Row]:
    session, place = _session(options, scene, source), _place(scene, source)
    out = options.out or Path()
    made = frames(session, place, count, out, options.csv, progress)
    return [row for rows in made for row in rows]


def _show(options: ViewerOptions, scene: Opened, source: Source, progress: Progress) -> list[Row]:
    from evaluation.viewer.window import Files, Viewer, open_window

    # The window first: its context is the one that the scene is uploaded to.
    width, height = scene.size
    window = open_window((width * across(options.layout), height), scene.scene.file.name)
    session, place = _session(options, scene, source), _place(scene, source)
    files = Files(options.out or Path(), options.csv, progress.note)
    viewer = Viewer(window, session, place, source, files, Comparer())
    viewer.run()
    return viewer.rows


def _session(options: ViewerOptions, scene: Opened, source: Source) -> Session:
    asked = options.render
    trained = None if source.folder is None else load_manifest(source.folder).tail
    if any(TECHNIQUES[name].needs_bundle for name in (asked.techniques[0], options.against)):
        check_trained_tail(asked.tail, trained)
    tail = chosen_tail(asked.tail, asked.g, trained)
    studio = Studio(scene.scene.gpu(), replace(asked.needs, bundle=source.folder), asked.background, tail.g)
    look = Look(
        view=scene.views[0],
        size=scene.size,
        left=asked.techniques[0],
        right=options.against,
        factor=asked.budget,
        tail=tail.name,
        layout=options.layout,
        perceptual=options.perceptual,
        readout=options.readout,
    )
    return Session(studio, look, scene.scene.file.stem, source.name, None if asked.tail else trained)


def _place(scene: Opened, source: Source) -> Place:
    arrays = scene.scene.now.scene
    names = parse_techniques([EVERY], source.folder is not None)
    return Place(names, scene.views, arrays.up, arrays.bounds)
