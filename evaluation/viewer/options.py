"""What a user can ask `diaphane view` for, checked before any work starts; and the scene, opened as it says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from evaluation.choices import check_budget
from evaluation.local_scenes import NAMED, Chosen, LocalScene, as_usd
from evaluation.render_options import RenderOptions
from evaluation.rendering import size_of
from evaluation.viewer.layout import LAYOUTS, Layout
from renderer.techniques import TECHNIQUES
from schemas.problem import ExitCode, Problem
from schemas.view import View

EXACT = "sbuffer"
"""What the left picture is held against if nothing else is asked for."""
MOST_FRAMES = 100_000


@dataclass(frozen=True, slots=True)
class ViewerOptions:
    """What to look at, and how.

    Attributes:
        render: Scene, technique on the left, budget, camera: as for `diaphane render`; one scene, one technique.
        against: Technique on the right.
        layout: How both are put together.
        view: Name of a view of the views file, or of a camera; None: the first.
        frames: Frames of an orbit, written without a window; None: a window.
        out: Folder of what is written; None: the one that the command runs in.
        csv: File of statistics that rows are added to; None: `statistics.csv` in `out`.
        readout: Whether numbers are written upon the picture.
        perceptual: Whether FLIP is computed.

    Raises:
        Problem: Something of it cannot be.
    """

    render: RenderOptions
    against: str
    layout: Layout
    view: str | None = None
    frames: int | None = None
    out: Path | None = None
    csv: Path | None = None
    readout: bool = True
    perceptual: bool = False

    def __post_init__(self) -> None:
        if len(self.render.techniques) != 1:
            raise Problem("One technique is shown on the left.", "Name one with --technique.")
        if self.against not in TECHNIQUES:
            known = ", ".join(TECHNIQUES)
            raise Problem(f"There is no technique '{self.against}'.", f"Choose among: {known}.", ExitCode.NOT_FOUND)
        for name in (*self.render.techniques, self.against):
            if TECHNIQUES[name].needs_bundle and self.render.bundle is None:
                raise Problem(f"{name} needs a bundle.", "Name one with --model or --bundle.")
        if self.frames is not None and not 1 <= self.frames <= MOST_FRAMES:
            raise Problem(f"{self.frames} frames cannot be rendered.", f"Give 1 to {MOST_FRAMES:,} with --frames.")
        if self.frames is not None and self.out is None:
            raise Problem("--frames writes files.", "Name their folder with --out.")
        if self.view is not None and self.render.views is None and self.render.camera is not None:
            raise Problem("Both --camera and --view say where to look from.", "Leave one of them out.")


def parse_layout(text: str) -> Layout:
    """A layout by its name.

    Raises:
        Problem: There is none of that name.
    """
    for layout in LAYOUTS:
        if layout == text:
            return layout
    raise Problem(f"There is no layout '{text}'.", f"Use one of {', '.join(LAYOUTS)}.")


@dataclass(frozen=True, slots=True)
class Opened:
    """A scene that can be looked at.

    Attributes:
        scene: Loaded at its time.
        views: The one to begin with, then all others that the stage or the views file has.
        size: Width and height of a picture.
    """

    scene: LocalScene
    views: tuple[View, ...]
    size: tuple[int, int]


@contextmanager
def opened(options: ViewerOptions) -> Iterator[Opened]:
    """The scene of some options, for as long as the context lasts; no OpenGL yet.

    Raises:
        Problem: It cannot be loaded, or has no such view.
    """
    asked = options.render
    with as_usd(asked.scenes[0]) as usd:
        scene = LocalScene(asked.scenes[0], usd, asked.load)
        scene.at(asked.frames[0] if asked.frames else None)
        chosen = _chosen(options, scene)
        size = size_of(asked, chosen[0].aspect)
        check_budget(asked.budget, "--budget 2", size)
        yield Opened(scene, tuple(each.view for each in chosen), size)


def _chosen(options: ViewerOptions, scene: LocalScene) -> list[Chosen]:
    """The view to begin with, then the others."""
    asked = options.render
    if asked.views is None:
        (first,) = scene.views(asked.camera or options.view, None)
        cameras = (Chosen(each.view, each.aspect, "camera of the stage") for each in scene.cameras())
        return [first, *(each for each in cameras if each.view != first.view)]
    listed = scene.views(asked.camera, asked.views)
    for first in listed:
        if options.view in (None, first.view.name):
            return [first, *(each for each in listed if each is not first)]
    names = ", ".join(each.view.name for each in listed[:NAMED])
    raise Problem(
        f"{asked.views} has no view '{options.view}' of {scene.file}.", f"There are: {names}.", ExitCode.NOT_FOUND
    )
