"""The fragment dump of a view on disk, and deep OpenEXR files: the work of `diaphane dump`."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evaluation.local_scenes import LocalScene, as_usd
from evaluation.writing import replacing
from renderer.capture import capture
from renderer.deep_exr import read_deep_exr, write_deep_exr
from renderer.dump import write_dump
from renderer.exr import camera_attributes
from renderer.frame import Frame
from renderer.opaque_depth import opaque_depth
from renderer.scene import LoadOptions
from schemas.fragments import FragmentDump
from schemas.problem import Problem

DEEP = ".exr"
DEEP_NAME = "fragments.exr"
ZARR_NAME = "fragments.zarr"


@dataclass(frozen=True, slots=True)
class DumpOptions:
    """Which view is dumped, and how.

    Attributes:
        file: A scene, or a deep OpenEXR file.
        output: Folder for both forms; or a deep OpenEXR file, by its suffix.
        deep: Whether the folder gets a deep OpenEXR file too.
        camera: Name or path of a camera.
        time: Time code; None: the start of the stage.
        load: How the scene is read; its time does not count.
        image_width: Pixels per row; rows follow from the camera.
        size: Width and height instead.
        background: Linear RGB where nothing opaque is.
    """

    file: Path
    output: Path
    deep: bool
    camera: str | None
    time: float | None
    load: LoadOptions
    image_width: int
    size: tuple[int, int] | None
    background: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Written:
    """A file or folder, its bytes, and milliseconds to write it."""

    path: Path
    bytes: int
    ms: float


@dataclass(frozen=True, slots=True)
class Dumped:
    """What was dumped.

    Attributes:
        width: Pixels per row.
        height: Rows.
        fragments: N.
        occupied: Pixels with fragments.
        most: Fragments of the pixel that has most.
        view: Name of the view, and why it is this one.
        passes: Milliseconds of the capture's passes.
        written: Files.
        warnings: Of the scene.
    """

    width: int
    height: int
    fragments: int
    occupied: int
    most: int
    view: tuple[str, str]
    passes: dict[str, float]
    written: tuple[Written, ...]
    warnings: tuple[str, ...]


def dump(options: DumpOptions) -> Dumped:
    """Capture a view and write it; or turn a deep OpenEXR file into a dump.

    Raises:
        Problem: The scene cannot be loaded, or the view has too many fragments.
    """
    if options.file.suffix.lower() == DEEP:
        return _imported(options)
    with as_usd(options.file) as usd:
        local = LocalScene(options.file, usd, options.load)
        scene = local.at(options.time)
        (chosen,) = local.views(options.camera, None)
        size = options.size or (options.image_width, max(1, int(options.image_width / chosen.aspect)))
        frame = Frame(local.gpu(), chosen.view, *size, options.background)
        captured = capture(frame)
        about: dict[str, Any] = {
            "scene": scene.name,
            "view": chosen.view.model_dump(mode="json"),
            "origin": scene.origin.tolist(),
            "metres_per_unit": scene.metres_per_unit,
            "units": "depth and view in metres, the view relative to the origin; colours gamma-2 encoded, alpha linear",
        }
        written = []
        if options.output.suffix.lower() != DEEP:
            written.append(_zarr(options.output, captured.dump, about))
        if options.deep or options.output.suffix.lower() == DEEP:
            path = options.output if options.output.suffix.lower() == DEEP else options.output / DEEP_NAME
            start = time.perf_counter()
            camera = camera_attributes(chosen.view, scene, *size)
            with replacing(path) as made:
                write_deep_exr(made, captured.dump, opaque_depth(frame), {**camera, "software": "diaphane"})
            written.append(Written(path, path.stat().st_size, 1e3 * (time.perf_counter() - start)))
    return _dumped(captured.dump, (chosen.view.name, chosen.how), captured.passes, written, scene.warnings)


def _imported(options: DumpOptions) -> Dumped:
    if options.deep or options.output.suffix.lower() == DEEP:
        raise Problem(f"{options.file} is a deep OpenEXR file already.", "Name a folder with -o, without --exr.")
    found = read_deep_exr(options.file)
    written = _zarr(options.output, found, {"scene": options.file.stem})
    return _dumped(found, ("", "of the file"), {}, [written], ())


def _zarr(folder: Path, found: FragmentDump, about: dict[str, Any]) -> Written:
    start = time.perf_counter()
    path = folder / ZARR_NAME
    with replacing(path) as made:
        write_dump(made.parent, found, about)
    ms = 1e3 * (time.perf_counter() - start)
    return Written(path, sum(file.stat().st_size for file in path.rglob("*") if file.is_file()), ms)


def _dumped(
    found: FragmentDump,
    view: tuple[str, str],
    passes: dict[str, float],
    written: list[Written],
    warnings: tuple[str, ...],
) -> Dumped:
    n = found.counts
    return Dumped(
        width=found.width,
        height=found.height,
        fragments=found.total,
        occupied=int((n > 0).sum()),
        most=int(n.max(initial=0)),
        view=view,
        passes=dict(passes),
        written=tuple(written),
        warnings=warnings,
    )
