"""The scenes that the renderer is measured on, and fair timing."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np

from benchmarks.casting.cases import SHARED
from benchmarks.render.thicket import thicket
from renderer.gpu_scene import GpuScene
from renderer.scene import LoadOptions, load_scene
from renderer.views import listed_views, placed_views, sampled_views
from schemas.view import View

MANIFEST = SHARED / "MANIFEST.json"
SPONZA = SHARED / "sponza" / "sponza.usdc"
ALPHA = 0.33
"""Opacity that every surface of sponza gets, as in the papers."""


@dataclass(frozen=True, slots=True)
class Subject:
    """A scene on the GPU and two views of it.

    Attributes:
        name: Of the scene.
        gpu: Uploaded.
        views: Two cameras.
        load_ms: Reading the stage.
        upload_ms: Bringing it to the GPU.
    """

    name: str
    gpu: GpuScene
    views: tuple[View, View]
    load_ms: float
    upload_ms: float


def subjects(ctx: moderngl.Context, names: tuple[str, ...]) -> list[Subject]:
    """The scenes of that name that are there: `thicket` always, `sponza` where the shared scenes are."""
    made = []
    with tempfile.TemporaryDirectory() as folder:
        if "thicket" in names:
            made.append(_subject(ctx, thicket(Path(folder)), None))
        if "sponza" in names and SPONZA.exists():
            made.append(_subject(ctx, SPONZA, ALPHA))
    return made


def _subject(ctx: moderngl.Context, path: Path, alpha: float | None) -> Subject:
    start = time.perf_counter()
    scene = load_scene(path, LoadOptions(alpha=alpha))
    loaded = time.perf_counter()
    gpu = GpuScene(ctx, scene)
    ctx.finish()
    uploaded = time.perf_counter()
    listed = listed_views(MANIFEST, path) if MANIFEST.parent in path.parents else ()
    views = [*placed_views(listed, scene), *scene.cameras, *sampled_views(scene, 2, 0)]
    return Subject(path.stem, gpu, (views[0], views[1]), 1e3 * (loaded - start), 1e3 * (uploaded - loaded))


def in_turns(rounds: int, work: Mapping[str, Callable[[], object]]) -> dict[str, dict[str, float]]:
    """Milliseconds of each piece of work, done by turns so that a busy machine is busy for all of them.

    Args:
        rounds: How often; one more before it warms up.
        work: What to time, by name. Each has to wait for the GPU itself.

    Returns:
        Name -> `median` and `least`.
    """
    times: dict[str, list[float]] = {name: [] for name in work}
    for number in range(rounds + 1):
        for name, call in work.items():
            start = time.perf_counter()
            call()
            if number:
                times[name].append(1e3 * (time.perf_counter() - start))
    return {name: {"median": float(np.median(t)), "least": float(np.min(t))} for name, t in times.items()}
