"""Stage `scene`: reads a stage once, and notes its views and what was found in it."""

from __future__ import annotations

from pathlib import Path

from renderer.usd.licence import authored_licence
from renderer.views import placed_views, scene_views
from schemas.view import ListedView
from services.stages.desk import Desk, save_facts
from services.store import file_sha256
from services.tasks import Report, Task


def make(desk: Desk, task: Task, folder: Path, report: Report) -> None:
    """Writes the facts of a scene.

    Raises:
        Problem: The file is not a scene, or a listed view has no direction.
    """
    scene = desk.scene(task)
    listed = [ListedView.model_validate(view) for view in task.params["views"]]
    views = placed_views(listed, scene) or scene_views(scene, task.params["count"], task.params["seed"])
    report(1.0, f"{scene.triangles:,} triangles, {len(views)} views")
    save_facts(
        folder,
        {
            "views": [view.model_dump(mode="json") for view in views],
            "triangles": scene.triangles,
            "opaque": scene.is_opaque,
            "content": file_sha256(desk.scene_path(task)),
            "warnings": list(scene.warnings),
            "licence": authored_licence(desk.scene_path(task)),
        },
    )
