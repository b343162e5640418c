"""Views of a scene, and what was found in it."""

from __future__ import annotations

from pathlib import Path

from evaluation.wording import counted
from renderer.usd.licence import authored_licence
from renderer.views import placed_views, scene_views
from schemas.canonical import file_sha256
from stages.desk import Desk
from stages.scene import SceneFacts, SceneParams
from stages.tasks import Report, Task


def make(desk: Desk, task: Task, params: SceneParams, folder: Path, report: Report) -> SceneFacts:
    """The facts of a scene: no file is written.

    Raises:
        Problem: The file is not a scene, or a listed view has no direction.
    """
    scene = desk.scene(task, params)
    views = placed_views(params.views, scene) or scene_views(scene, params.count, params.seed)
    report(1.0, f"{counted(scene.triangles, 'triangles')}, {counted(len(views), 'views')}")
    return SceneFacts(
        views=tuple(views),
        triangles=scene.triangles,
        opaque=scene.is_opaque,
        content=file_sha256(desk.scene_path(task)),
        warnings=tuple(scene.warnings),
        licence=authored_licence(desk.scene_path(task)),
    )
