"""What the bodies of all stages share: artifacts, and the scene that is on the GPU right now."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from schemas.problem import ExitCode, Problem
from stages.loading import Loading
from stages.pictured import Pictured
from stages.stage import Facts
from stages.store import Store
from stages.tasks import FACTS, Source, Task

if TYPE_CHECKING:
    from renderer.frame import Frame
    from renderer.gpu_scene import GpuScene
    from schemas.scene import SceneArrays

F = TypeVar("F", bound=Facts)

BUNDLE = "bundle"
"""Folder of the bundle in an `export` artifact."""
PAGE = "index.html"
"""File of the page in a `report` artifact."""
SHARD = "shard.safetensors"
"""File of the training rows in a `label` artifact."""

FolderOf = Callable[[Source], Path]
"""Where the files of a source lie on this machine."""


class Desk:
    """State of a process that does tasks one after the other.

    Args:
        store: Where artifacts lie.
        folder_of: Where sources lie.
    """

    def __init__(self, store: Store, folder_of: FolderOf) -> None:
        self.store, self._folder_of = store, folder_of
        self._loaded: tuple[str, float | None, str] | None = None
        self._scene: SceneArrays | None = None
        self._gpu: GpuScene | None = None
        self._compiled: set[str] = set()

    def artifact(self, task: Task, stage: str) -> Path:
        """Folder of the one artifact of a stage that the task needs."""
        (needed,) = (need for need in task.needs if need.startswith(f"{stage}/"))
        return self.store.fetch(needed)

    def scene_path(self, task: Task) -> Path:
        """The file that a task's scene is opened from."""
        source = _present(task.scene, task)
        if source.root.lower().endswith(".glb"):
            from renderer.convert import stage_file

            converted: Path = stage_file(self._folder_of(source), source.root, self.cache)
            return converted
        return self._folder_of(source) / source.root

    def bundle(self, task: Task) -> Path:
        """Folder of the bundle that a task reads: a published one, or one just exported."""
        if any(need.startswith("export/") for need in task.needs):
            return self.artifact(task, "export") / BUNDLE
        return self._folder_of(_present(task.bundle, task))

    @property
    def cache(self) -> Path:
        """Folder for what can be made again at any time."""
        folder = self.store.root / "tmp"
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def checkpoint(self, task: Task) -> Path:
        """File that an interrupted training goes on from: the artifact's key names exactly this training."""
        folder = self.store.checkpoints
        folder.mkdir(parents=True, exist_ok=True)
        return folder / f"{task.address.key}.safetensors"

    def scene(self, task: Task, loading: Loading) -> SceneArrays:
        """The scene's triangles; only the last one asked for is kept in memory.

        Args:
            task: Names the scene.
            loading: How its surfaces are loaded.
        """
        from renderer.scene import LoadOptions, load_scene

        wanted = _present(task.scene, task).digest, loading.alpha, loading.glass
        if self._scene is None or self._loaded != wanted:
            self._gpu, self._scene = None, None
            path = self.scene_path(task)
            options = LoadOptions(alpha=loading.alpha, glass=loading.glass, home=self._home(task, path))
            self._scene = load_scene(path, options)
            self._loaded = wanted
        return self._scene

    def _home(self, task: Task, path: Path) -> Path | None:
        """Folder that a stranger's scene, opened from a path, is read from alone."""
        source = _present(task.scene, task)
        folder = self._folder_of(source)
        return None if source.trusted else folder if path.is_relative_to(folder) else path.parent

    def gpu(self, task: Task, loading: Loading) -> GpuScene:
        """The scene on the GPU: all views of a scene reuse one upload."""
        from renderer.context import gl_context
        from renderer.gpu_scene import GpuScene

        scene = self.scene(task, loading)
        if self._gpu is None:
            self._gpu = GpuScene(gl_context(), scene)
            self._compiled = set()
        return self._gpu

    def compiled(self, task: Task, loading: Loading) -> set[str]:
        """Names of the techniques whose shaders were compiled for the scene on the GPU."""
        self.gpu(task, loading)
        return self._compiled

    def frame(self, task: Task, picture: Pictured) -> Frame:
        """The frame of a task's view on the GPU."""
        from renderer.frame import Frame

        return Frame(self.gpu(task, picture), picture.view, *picture.size)


def save_facts(folder: Path, facts: Facts) -> None:
    """Writes what the pipeline has to know of an artifact."""
    (folder / FACTS).write_text(json.dumps(facts.model_dump(mode="json"), allow_nan=False), encoding="utf-8")


def load_facts(folder: Path, kind: type[F]) -> F:
    """Reads what `save_facts` wrote."""
    return kind.model_validate_json((folder / FACTS).read_text(encoding="utf-8"))


def _present(source: Source | None, task: Task) -> Source:
    if source is None:
        raise Problem(
            f"The task {task.stage} {task.name} names no files.", "Submit the job again.", ExitCode.CHECK_FAILED
        )
    return source
