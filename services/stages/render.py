"""Stage `render`: the fragment dump of every view."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from renderer.capture import capture
from renderer.dump import write_dump
from renderer.frame import Frame
from schemas.view import View
from services.stages.scenes import scene_version
from services.stages.workspace import SceneEntry, Workspace
from services.store import Address
from services.versions import code_version

_SOURCES = (
    "schemas.fragments",
    "renderer.capture",
    "renderer.csr",
    "renderer.dump",
    "renderer.frame",
    "renderer.gpu_scene",
    "renderer.programs",
    *(f"renderer.shaders.{name}" for name in ("common", "opaque", "count", "gather", "capture")),
)


@dataclass(frozen=True, slots=True)
class RenderedView:
    """A view whose fragments are known.

    Attributes:
        scene: The scene it is a view of.
        view: The camera.
        address: Of the dump.
        folder: Where the dump is.
        total: N, its fragments.
        occupied: Pixels with at least one.
        passes: Milliseconds of each pass of the capture.
    """

    scene: SceneEntry
    view: View
    address: Address
    folder: Path
    total: int
    occupied: int
    passes: dict[str, float]


def frame_of(work: Workspace, scene: SceneEntry, view: View) -> Frame:
    """The view's frame on the GPU."""
    return Frame(work.gpu(scene.path), view, work.options.width, work.options.height)


def render_views(work: Workspace, scenes: tuple[SceneEntry, ...]) -> tuple[RenderedView, ...]:
    """Dumps of all views that have a transparent fragment; the others are counted as skipped."""
    rendered = []
    with work.progress.stage("capture fragments", sum(len(scene.views) for scene in scenes)) as stage:
        for scene in scenes:
            for view in scene.views:
                made = _render(work, scene, view)
                stage.advance(1, f"{scene.label} {view.name}: {made.total:,} fragments")
                if made.total == 0:
                    work.progress.skipped("views without a transparent pixel")
                    continue
                rendered.append(made)
    return tuple(rendered)


def _render(work: Workspace, scene: SceneEntry, view: View) -> RenderedView:
    options = work.options
    params = {
        "view": view.model_dump(mode="json"),
        "size": [options.width, options.height],
        "alpha": options.alpha,
    }
    address = Address("render", code_version(*_SOURCES) + scene_version(), (scene.digest,), params)
    folder = work.store.get(address)
    if folder is None:
        work.worked = True
        with work.store.put(address) as made:
            captured = capture(frame_of(work, scene, view))
            write_dump(made, captured.dump)
            facts = {
                "total": captured.dump.total,
                "occupied": int((captured.dump.counts > 0).sum()),
                "passes": captured.passes,
            }
            (made / "capture.json").write_text(json.dumps(facts), encoding="utf-8")
        folder = work.store.path(address)
    else:
        work.progress.skipped("views already captured")
    facts = json.loads((folder / "capture.json").read_text(encoding="utf-8"))
    return RenderedView(scene, view, address, folder, facts["total"], facts["occupied"], facts["passes"])
