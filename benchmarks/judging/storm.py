"""A stage as Storm shows it without light: its own shaders, but for the text that lights a UsdPreviewSurface."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.judging.seen import Seen
from evaluation.storm.engine import Engine, resources, run_child
from evaluation.storm.resolve import SHADER, replaced
from schemas.problem import ExitCode, Problem

_SURFACE = Path("usdShaders/resources/shaders/previewSurface.glslfx")
_FALLBACK = Path("hdSt/resources/shaders/fallbackMaterialNetwork.glslfx")
_UNLIT = {
    _SURFACE: (re.compile(r"vec3 c = evaluateLights\(.*?\)\);", re.DOTALL), "vec3 c = emissiveColor + diffuseColor;"),
    _FALLBACK: (re.compile(r"color\.rgb = FallbackLighting\(.*?\);", re.DOTALL), ""),
}
"""What lights a surface with a UsdPreviewSurface, or without a material, and what stands there instead."""

Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Shot:
    """A picture.

    Attributes:
        size: Width and height.
        camera: Path of a camera of the stage, read by Storm; None: `view` and `projection`.
        view: World to view in stage units, 16 numbers row by row, for row vectors.
        projection: The same of the projection.
        clip: Near and far, stage units; of a camera only where it has no authored range.
        orthographic: Whether rays are parallel.
        refine: Levels of subdivision.
        materials: Whether materials are shown, or only what shape things have.
        cards: Whether models are drawn by their draw mode, as cards or bounds. The loader reads none.
    """

    size: tuple[int, int]
    camera: str | None
    view: Numbers
    projection: Numbers
    clip: tuple[float, float]
    orthographic: bool
    refine: int
    materials: bool
    cards: bool = False


@dataclass(frozen=True, slots=True)
class Job:
    """Pictures of a stage.

    Attributes:
        stage: The root layer.
        modules: Folder with `pxr`.
        variants: Prim, set and choice.
        time: Time code; None: the earliest.
        shots: The pictures.
        out: Folder they are written to.
    """

    stage: str
    modules: str
    variants: tuple[tuple[str, str, str], ...]
    time: float | None
    shots: tuple[Shot, ...]
    out: str


def shown(
    engine: Engine, stage: Path, variants: Sequence[tuple[str, str, str]], time: float | None, shots: Sequence[Shot]
) -> tuple[str, list[Seen]]:
    """Render a stage in Storm, in a process of its own.

    Returns:
        The version of OpenUSD, and the pictures.

    Raises:
        Problem: There are no pictures.
    """
    with tempfile.TemporaryDirectory(prefix="diaphane-judge-") as name:
        folder = Path(name)
        texts: dict[Path, Callable[[str], str]] = {
            SHADER: lambda text: replaced(text, "exact"),
            **{file: partial(_unlit, file) for file in _UNLIT},
        }
        plugins = resources(engine, folder, texts)
        job = Job(str(stage.resolve()), str(engine.modules), tuple(variants), time, tuple(shots), str(folder))
        told = run_child(engine, Path(__file__).with_name("child.py"), asdict(job), plugins)
        return told["version"], [
            Seen(np.load(folder / f"{number}.rgba.npy"), np.load(folder / f"{number}.depth.npy"))
            for number in range(len(shots))
        ]


def _unlit(file: Path, text: str) -> str:
    lit, instead = _UNLIT[file]
    made, count = lit.subn(instead, text)
    if count != 1:
        raise Problem(
            f"The shader {file.name} of this OpenUSD has another layout than the known ones.",
            "Use the one of `make peers`.",
            ExitCode.CONFLICT,
        )
    return made
