"""What all stages share: the store, progress, and the scene that is on the GPU right now."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from renderer.context import gl_context
from renderer.gpu_scene import GpuScene
from renderer.scene import LoadOptions, load_scene
from schemas.scene import SceneArrays
from schemas.view import View
from services.options import BuildOptions
from services.progress import Progress
from services.store import Store


@dataclass(frozen=True, slots=True)
class SceneEntry:
    """A scene of the build.

    Attributes:
        path: The USD file.
        label: Unique short name.
        digest: Content hash of the file and all that it refers to.
        held_out: Whether it is evaluated on and never trained on.
        views: Its views.
        triangles: Number of triangles.
        opaque: Whether nothing in it is transparent.
        warnings: What of the file was not supported or was missing.
    """

    path: Path
    label: str
    digest: str
    held_out: bool
    views: tuple[View, ...]
    triangles: int
    opaque: bool
    warnings: tuple[str, ...]


@dataclass(slots=True)
class Workspace:
    """State of one build.

    Attributes:
        options: What was asked for.
        store: Where artifacts lie.
        progress: Where progress goes.
        worked: Whether any artifact was made.
    """

    options: BuildOptions
    store: Store
    progress: Progress
    worked: bool = False
    _path: Path | None = None
    _scene: SceneArrays | None = None
    _gpu: GpuScene | None = None
    _compiled: set[str] = field(default_factory=set)

    def scene(self, path: Path) -> SceneArrays:
        """The scene's triangles; only the last one asked for is kept in memory."""
        if self._scene is None or self._path != path:
            self._gpu = None
            self._scene = load_scene(path, LoadOptions(alpha=self.options.alpha))
            self._path = path
        return self._scene

    def gpu(self, path: Path) -> GpuScene:
        """The scene on the GPU: all views of a scene reuse one upload."""
        scene = self.scene(path)
        if self._gpu is None:
            self._gpu = GpuScene(gl_context(), scene)
            self._compiled.clear()
        return self._gpu

    def compiled(self, path: Path) -> set[str]:
        """Names of the techniques whose shaders were compiled for the scene on the GPU."""
        self.gpu(path)
        return self._compiled

    @property
    def budgets(self) -> tuple[int, ...]:
        """Budgets in fragments, F."""
        area = self.options.width * self.options.height
        return tuple(int(factor * area) for factor in self.options.budgets)
