"""Storm as it is installed, and with the nearest eight and a tail, against Storm with its whole lists sorted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from evaluation.local_scenes import as_usd
from evaluation.storm.engine import POOL_BYTES, Engine, Picture, picture
from renderer.metrics import mse
from renderer.scene import LoadOptions, load_scene
from renderer.views import framing_view
from schemas.problem import Problem

_FULL = np.array([255, 0, 255, 255], np.uint8)
"""What `exact.glsl` writes everywhere if the pool was full."""
_SHOWN = 8
"""Differences in contact sheets are multiplied by it."""

Pixels = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Compared:
    """A scene in Storm.

    Attributes:
        scene: The file's name.
        alpha: Opacity of every surface; None: as authored.
        width: Of the pictures.
        height: Of the pictures.
        version: Of OpenUSD.
        mse: Of Storm as installed against its exact picture: 8-bit sRGB over black, values in [0, 1], whole image.
        mse_nearest: The same with the nearest eight and a tail.
        cpu_seconds: Of a frame as installed, with reading back and writing.
        cpu_seconds_nearest: The same with the nearest eight and a tail.
        pool_bytes: Of the lists: all three have the same.
        problem: Why there is no comparison.
    """

    scene: str
    alpha: float | None
    width: int
    height: int
    version: str | None = None
    mse: float | None = None
    mse_nearest: float | None = None
    cpu_seconds: float | None = None
    cpu_seconds_nearest: float | None = None
    pool_bytes: int | None = None
    problem: str | None = None

    def json(self) -> dict[str, Any]:
        """Of plain values only."""
        return asdict(self)


def compare(
    engine: Engine, scenes: Iterable[Path], size: tuple[int, int], alpha: float | None, sheets: Path | None
) -> Iterator[Compared]:
    """Every scene from the view that frames it, one after the other.

    Args:
        engine: Where Storm is installed.
        scenes: Files.
        size: Width and height.
        alpha: Opacity of every UsdPreviewSurface; None: as authored.
        sheets: Folder of contact sheets, `NAME.png`: exact, as installed, nearest eight and a tail; below, eight times
            the differences from the exact one. None: none are written.
    """
    for file in scenes:
        try:
            yield _compared(engine, file, size, alpha, sheets)
        except Problem as problem:
            yield Compared(file.stem, alpha, *size, problem=problem.title)


def _compared(engine: Engine, file: Path, size: tuple[int, int], alpha: float | None, sheets: Path | None) -> Compared:
    with as_usd(file) as usd:
        scene = load_scene(usd, LoadOptions())
        view = framing_view(scene)
        exact = picture(engine, usd, scene, view, size, alpha, "exact", frames=1)
        if (exact.pixels == _FULL).all(axis=2).any():
            raise Problem("Storm's pool of 8 fragments per pixel is full.", "Ask for a view with fewer layers.")
        shipped = picture(engine, usd, scene, view, size, alpha)
        nearest = picture(engine, usd, scene, view, size, alpha, "nearest")
    if sheets is not None:
        sheets.mkdir(parents=True, exist_ok=True)
        Image.fromarray(sheet([_rgb(each) for each in (exact, shipped, nearest)])).save(sheets / f"{file.stem}.png")
    height, width = exact.pixels.shape[:2]
    return Compared(
        scene=file.stem,
        alpha=alpha,
        width=width,
        height=height,
        version=exact.version,
        mse=mse(_rgb(shipped), _rgb(exact)),
        mse_nearest=mse(_rgb(nearest), _rgb(exact)),
        cpu_seconds=shipped.cpu_seconds,
        cpu_seconds_nearest=nearest.cpu_seconds,
        pool_bytes=POOL_BYTES * width * height,
    )


def sheet(pictures: Sequence[Pixels]) -> Pixels:
    """Pictures side by side, below each eight times its difference from the first; uint8 [2 H, n W, 3]."""
    first = pictures[0].astype(int)
    differences = [np.clip(_SHOWN * np.abs(each.astype(int) - first), 0, 255).astype(np.uint8) for each in pictures]
    return np.concatenate([np.concatenate(pictures, axis=1), np.concatenate(differences, axis=1)], axis=0)


def table(found: Sequence[Compared]) -> str:
    """Markdown, a row a scene."""
    lines = [
        "| scene | opacity | Storm, MSE x1e-5 | nearest 8 and a tail | less by | CPU s a frame | with nearest 8 |",
        "|---|---|---|---|---|---|---|",
    ]
    for one in found:
        opacity = "authored" if one.alpha is None else f"{one.alpha:g}"
        if one.mse is None or one.mse_nearest is None:
            lines.append(f"| {one.scene} | {opacity} | {one.problem} | | | | |")
            continue
        ratio = f"{one.mse / one.mse_nearest:.0f}x" if one.mse_nearest > 0.0 else "-"
        lines.append(
            f"| {one.scene} | {opacity} | {1e5 * one.mse:.3g} | {1e5 * one.mse_nearest:.3g} | {ratio} "
            f"| {one.cpu_seconds:.2f} | {one.cpu_seconds_nearest:.2f} |"
        )
    return "\n".join(lines) + "\n"


def _rgb(made: Picture) -> Pixels:
    return made.pixels[..., :3]
