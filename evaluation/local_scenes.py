"""Scene files of one's own: opened, converted if they are no USD, loaded at one time after the other, and looked at."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from pxr import Usd, UsdRender, UsdUtils

from renderer.context import gl_context
from renderer.convert_meshes import MESH_SUFFIXES, convert_meshes
from renderer.gpu_scene import GpuScene
from renderer.scene import LoadOptions, load_scene
from renderer.timecodes import is_animated
from renderer.usd.cameras import StageCamera, read_cameras
from renderer.usd.stage import WarningLog, stage_time, usd_diagnostics
from renderer.views import ASPECT, FRAMING_ASPECT, framing_view, listed_views, placed_views
from schemas.problem import ExitCode, Problem
from schemas.scene import SceneArrays
from schemas.view import View

NAMED = 12
"""Cameras that a message lists."""


@contextmanager
def as_usd(path: Path) -> Iterator[Path]:
    """A scene file as USD: itself, or what it is converted to, for as long as the context lasts.

    Raises:
        Problem: It cannot be converted.
    """
    if path.suffix.lower() not in MESH_SUFFIXES:
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="diaphane-") as folder:
        made = Path(folder) / f"{path.stem}.usdc"
        convert_meshes(path, made)
        yield made


@dataclass(frozen=True, slots=True)
class Chosen:
    """A view, and why it is this one.

    Attributes:
        view: The camera.
        aspect: Width / height that it is meant for.
        how: In words.
    """

    view: View
    aspect: float
    how: str


@dataclass(frozen=True, slots=True)
class _Loaded:
    """A scene at a time.

    Attributes:
        scene: Its triangles.
        stage: Where they come from.
        time: When cameras are read; all else too, if it moves.
        animated: Whether anything but cameras moves.
    """

    scene: SceneArrays
    stage: Usd.Stage
    time: Usd.TimeCode
    animated: bool


class LocalScene:
    """A scene; what does not change from frame to frame is loaded once.

    Args:
        file: As the user named it.
        usd: The stage to open, see `as_usd`.
        options: How it is read; the time does not count.
    """

    def __init__(self, file: Path, usd: Path, options: LoadOptions) -> None:
        self.file, self._usd, self._options = file, usd, options
        self._loaded: _Loaded | None = None
        self._gpu: GpuScene | None = None

    def at(self, time: float | None) -> SceneArrays:
        """The scene at a time code, and from now on everything else here.

        Args:
            time: None: the start of the stage's range; not a number: the default time.

        Raises:
            Problem: There is no such file, or it is no scene.
        """
        was = self._loaded
        if was is not None and not (was.animated and stage_time(was.stage, time) != was.time):
            self._loaded = replace(was, time=stage_time(was.stage, time))
            return was.scene
        self._gpu, self._loaded = None, None
        stages: list[Usd.Stage] = []
        options = replace(self._options, time=time)
        scene = load_scene(self._usd, options, lambda draw, _: stages.append(draw.prim.GetStage()))
        self._loaded = _Loaded(scene, stages[0], stage_time(stages[0], time), is_animated(stages[0]))
        return scene

    @property
    def now(self) -> _Loaded:
        """What the last `at` loaded."""
        assert self._loaded is not None, "`at` comes first"
        return self._loaded

    @property
    def start(self) -> float:
        """Time code at which the stage is read if none is asked for, as a number for file names."""
        time = stage_time(self.now.stage, None)
        return 0.0 if time.IsDefault() or time.IsEarliestTime() else float(time.GetValue())

    def gpu(self) -> GpuScene:
        """The scene on the GPU."""
        if self._gpu is None:
            self._gpu = GpuScene(gl_context(), self.now.scene)
        return self._gpu

    def cameras(self) -> tuple[StageCamera, ...]:
        """The stage's cameras."""
        scene = self.now.scene
        # What cannot be used was reported when the scene was loaded.
        with usd_diagnostics(WarningLog()):
            return read_cameras(self.now.stage, self.now.time, scene.origin, scene.metres_per_unit, WarningLog())

    def views(self, camera: str | None, listed: Path | None) -> tuple[Chosen, ...]:
        """The views to render.

        Args:
            camera: Name or path of a camera of the stage. None: the one of the stage's render settings, else the
                primary one (`main_cam`), else the first, else the whole scene.
            listed: A views file; all its views of this scene.

        Raises:
            Problem: There is no such camera, or no view of this scene in the file.
        """
        if listed is None:
            return (self._camera(camera),)
        if camera is not None:
            raise Problem("Both --camera and --views set the camera.", "Leave one of them out.")
        views = placed_views(listed_views(listed, self.file), self.now.scene)
        if not views:
            raise Problem(
                f"{listed} has no views of {self.file}.",
                'List it there: {"scenes": [{"main": "file.usd", "views": [...]}]}.',
                ExitCode.NOT_FOUND,
            )
        return tuple(Chosen(view, ASPECT, f"of {listed.name}") for view in views)

    def _camera(self, name: str | None) -> Chosen:
        cameras = self.cameras()
        if name is not None:
            return self._named(name, cameras)
        for wanted, how in (
            (self._settings_camera(), "camera of the render settings"),
            (str(UsdUtils.GetPrimaryCameraName()), "primary camera"),
        ):
            for camera in cameras:
                if wanted and wanted in (camera.path, camera.path.rpartition("/")[2]):
                    return Chosen(camera.view, camera.aspect, how)
        if cameras:
            return Chosen(cameras[0].view, cameras[0].aspect, "first camera of the stage")
        return Chosen(framing_view(self.now.scene), FRAMING_ASPECT, "no camera: the whole scene")

    def _named(self, name: str, cameras: tuple[StageCamera, ...]) -> Chosen:
        for camera in cameras:
            if name in (camera.path, camera.path.lstrip("/"), camera.path.rpartition("/")[2], camera.view.name):
                return Chosen(camera.view, camera.aspect, "as asked for")
        there = ", ".join(camera.path for camera in cameras[:NAMED]) or "none"
        raise Problem(
            f"{self.file} has no camera '{name}' that can be used.", f"There are: {there}.", ExitCode.NOT_FOUND
        )

    def _settings_camera(self) -> str:
        """Path of the camera of the stage's render settings; empty if there is none."""
        settings = UsdRender.Settings.GetStageRenderSettings(self.now.stage)
        targets = settings.GetCameraRel().GetTargets() if settings else []
        return str(targets[0]) if len(targets) == 1 else ""
