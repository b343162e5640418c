"""Where Storm is installed, a copy of its resources with another resolve, and a picture by a process of its own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evaluation.storm.resolve import SHADER, Resolve, replaced
from schemas.problem import ExitCode, Problem
from schemas.scene import SceneArrays
from schemas.view import View

POOL_BYTES = 8 * (16 + 4 + 4) + 4
"""Bytes a pixel of Storm's pool and heads, as `renderer.techniques.storm_rules` has them."""

_CHILD = Path(__file__).with_name("child.py")
_SECONDS = 600
_INSTALL = "Install one with `make peers`, or name its interpreter with --python."


@dataclass(frozen=True, slots=True)
class Engine:
    """An installed OpenUSD with Storm, as the wheel `bpy` has it.

    Attributes:
        python: Its interpreter.
        plugins: Folder of its plug-ins' resources.
        modules: Folder with its `pxr`.
    """

    python: Path
    plugins: Path
    modules: Path

    @classmethod
    def of(cls, python: Path) -> Engine:
        """The one that belongs to an interpreter.

        Raises:
            Problem: There is none.
        """
        if not python.is_file():
            raise Problem(f"There is no interpreter {python}.", _INSTALL, ExitCode.NOT_FOUND)
        for site in sorted(python.parent.parent.glob("lib/python*/site-packages/bpy")):
            modules = sorted(site.glob("*/python/lib/python*/site-packages"))
            if (site / "lib/usd" / SHADER).is_file() and modules:
                return cls(python, site / "lib/usd", modules[0])
        raise Problem(f"{python} has no OpenUSD with Storm.", _INSTALL, ExitCode.NOT_FOUND)


@dataclass(frozen=True, slots=True)
class Job:
    """A picture to make.

    Attributes:
        stage: The root layer.
        modules: Folder with `pxr`.
        camera: 16 numbers row by row, camera to world in stage units, for row vectors as USD has them.
        fov: Vertical, degrees.
        clip: Near and far, stage units.
        size: Width and height.
        alpha: Opacity of every UsdPreviewSurface; None: as authored.
        frames: How often it is rendered; the first one compiles shaders.
        out: PNG, sRGB, over black.
    """

    stage: str
    modules: str
    camera: tuple[float, ...]
    fov: float
    clip: tuple[float, float]
    size: tuple[int, int]
    alpha: float | None
    frames: int
    out: str


@dataclass(frozen=True, slots=True)
class Picture:
    """What Storm made.

    Attributes:
        pixels: uint8 [H, W, 4], sRGB, premultiplied, over black.
        seconds: Of the last frame, with reading back and writing.
        cpu_seconds: The same of the process's CPU time.
        version: Of OpenUSD.
    """

    pixels: NDArray[np.uint8]
    seconds: float
    cpu_seconds: float
    version: str


def picture(
    engine: Engine,
    stage: Path,
    scene: SceneArrays,
    view: View,
    size: tuple[int, int],
    alpha: float | None = None,
    resolve: Resolve | None = None,
    frames: int = 2,
) -> Picture:
    """Render a stage in Storm.

    Args:
        engine: Where it is installed.
        stage: The root layer.
        scene: The stage as it is loaded here: its origin, unit and bounds.
        view: A perspective one without shift.
        size: Width and height.
        alpha: Opacity of every UsdPreviewSurface; None: as authored.
        resolve: Another resolve, in a copy of the resources; None: the one that is installed.
        frames: How often; the last one is timed.

    Raises:
        Problem: There is no picture.
    """
    near, far = view.clip_range(scene.bounds)
    matrix = np.linalg.inv(view.world_to_view())
    matrix[:3, 3] = (np.array(view.eye) + scene.origin) / scene.metres_per_unit
    with tempfile.TemporaryDirectory(prefix="diaphane-storm-") as folder:
        job = Job(
            stage=str(stage.resolve()),
            modules=str(engine.modules),
            camera=tuple(matrix.T.ravel().tolist()),
            fov=view.fov,
            clip=(near / scene.metres_per_unit, far / scene.metres_per_unit),
            size=size,
            alpha=alpha,
            frames=frames,
            out=str(Path(folder) / "picture.png"),
        )
        told = run_child(engine, _CHILD, asdict(job), _resolving(engine, Path(folder), resolve))
        if not Path(job.out).is_file():
            raise Problem(f"Storm made no picture of {stage}.", "Try the stage in usdview.")
        with Image.open(job.out) as image:
            pixels = np.asarray(image.convert("RGBA"))
    return Picture(pixels, told["seconds"][-1], told["cpu_seconds"][-1], told["version"])


def _resolving(engine: Engine, folder: Path, resolve: Resolve | None) -> Path | None:
    """Resources with another resolve; None: as installed."""
    return None if resolve is None else resources(engine, folder, {SHADER: lambda text: replaced(text, resolve)})


def resources(engine: Engine, folder: Path, texts: Mapping[Path, Callable[[str], str]]) -> Path:
    """A copy of Storm's resources with other texts, for one process.

    Args:
        engine: Where it is installed.
        folder: Gets the copy.
        texts: Of files, relative to the folder of plug-ins: what makes the new text of the old one.

    Returns:
        The copy, for `run_child`.
    """
    copied = folder / "usd"
    shutil.copytree(engine.plugins, copied)
    for library in engine.plugins.parent.glob("libusd_ms.*"):
        (folder / library.name).symlink_to(library)
    for name, changed in texts.items():
        file = copied / name
        file.write_text(changed(file.read_text(encoding="utf-8")), encoding="utf-8")
    return copied


def run_child(
    engine: Engine,
    script: Path,
    job: Mapping[str, Any],
    plugins: Path | None,
) -> dict[str, Any]:
    """Run a script in a process that has Storm.

    Args:
        engine: Where it is installed.
        script: Reads the job from its standard input, and prints a line of JSON.
        job: Has `stage` and `modules`, for the script.
        plugins: Resources that are found before those that are installed (`resources`).

    Raises:
        Problem: It fails, or takes too long.
    """
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "PXR_"))}
    if plugins is not None:
        environment["PXR_PLUGINPATH_NAME"] = str(plugins)
    command = [str(engine.python), str(script)]
    try:
        done = subprocess.run(
            command, input=json.dumps(job), env=environment, capture_output=True, text=True, timeout=_SECONDS
        )
    except subprocess.TimeoutExpired as error:
        raise Problem(f"Storm took more than {_SECONDS} s for {job['stage']}.", "Ask for a smaller picture.") from error
    lines = done.stdout.strip().splitlines()
    if done.returncode or not lines:
        reason = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise Problem(f"Storm made no picture of {job['stage']}: {reason}.", "Try the stage in usdview.")
    told: dict[str, Any] = json.loads(lines[-1])
    return told
