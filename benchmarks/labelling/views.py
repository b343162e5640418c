"""Captured views that the labeller is measured on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.casting.cases import MODES, Case
from renderer.capture import capture
from renderer.context import gl_context
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.scene import LoadOptions, load_scene
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.scene import SceneArrays

SIZE = (1430, 960)


@dataclass(frozen=True, slots=True)
class CapturedView:
    """A view of a stage.

    Attributes:
        scene: The scene's name.
        stage: The stage's file, relative to the scene's folder.
        mode: Name from MODES.
        view: The camera's name.
        dump: Its fragments; None where the capture is of no use, and `why` says so.
        why: Why there are none.
    """

    scene: str
    stage: str
    mode: str
    view: str
    dump: FragmentDump | None
    why: str = ""

    @property
    def key(self) -> tuple[str, str, str, str]:
        """What tells it from other views."""
        return self.scene, self.stage, self.mode, self.view


def captured_views(
    case: Case, size: tuple[int, int], most: int | None, known: frozenset[tuple[str, str, str, str]] = frozenset()
) -> Iterator[CapturedView]:
    """The views of a stage in both modes, one at a time; a view is gone when the next one is asked for.

    Args:
        case: The stage.
        size: Pixels per row, rows.
        most: Most views of the stage, spread over those that are listed; None: all of them.
        known: Keys of the views to leave out.
    """
    for mode, alpha in MODES.items():
        try:
            scene = load_scene(case.path, LoadOptions(alpha=alpha, variants=case.variants))
        except Problem as problem:
            yield CapturedView(case.scene, stage_of(case), mode, "", None, problem.title)
            return
        yield from views_of_scene(case, scene, mode, size, most, known)


def views_of_scene(
    case: Case,
    scene: SceneArrays,
    mode: str,
    size: tuple[int, int],
    most: int | None,
    known: frozenset[tuple[str, str, str, str]] = frozenset(),
) -> Iterator[CapturedView]:
    """The views of a stage that is loaded, one at a time.

    Args:
        case: The stage.
        scene: As loaded.
        mode: What the views are said to be of.
        size: Pixels per row, rows.
        most: As of `captured_views`.
        known: As of `captured_views`.
    """
    stage = stage_of(case)
    if scene.is_opaque:
        yield CapturedView(case.scene, stage, mode, "", None, "nothing in it is transparent")
        return
    gpu = GpuScene(gl_context(), scene)
    for view in case.cameras(scene, most):
        if (case.scene, stage, mode, view.name) not in known:
            dump = capture(Frame(gpu, view, *size)).dump
            yield CapturedView(case.scene, stage, mode, view.name, dump)


def stage_of(case: Case) -> str:
    """The stage's file, relative to the scene's folder."""
    return str(case.path).rpartition(f"/{case.scene}/")[2]
