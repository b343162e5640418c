"""One stage, checked: the loader against the second reader, the renderer against rays."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray
from pxr import Tf

from benchmarks.casting.cases import MODES, Case
from benchmarks.casting.embree import Embree, met
from benchmarks.casting.loader import Comparison, compare
from benchmarks.casting.opacity import classify
from benchmarks.casting.rays import Camera, cast
from benchmarks.casting.reading import StageReading
from benchmarks.casting.verdict import Tally, judge
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.opaque_depth import opaque_depth
from renderer.scene import LoadOptions, load_scene
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.scene import SceneArrays
from schemas.view import View


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is checked.

    Attributes:
        size: Pixels per row and rows.
        views: Views of each stage.
        pixels: Rays through each view.
        embree: Most triangles for which embree builds its tree.
        pairs: Most triangles that are paired with the second reader's.
        modes: Names from MODES.
    """

    size: tuple[int, int] = (640, 430)
    views: int = 2
    pixels: int = 1000
    embree: int = 10**9
    pairs: int = 10**9
    modes: tuple[str, ...] = tuple(MODES)


@dataclass(slots=True)
class Result:
    """What was found about one stage.

    Attributes:
        case: The stage.
        loader: Against the second reader; None where there are too many triangles, or nothing to draw.
        tallies: Against the rays, by mode.
        load_seconds: Processor time of loading.
        refused: Why the loader found nothing to draw, where the second reader did not either.
    """

    case: Case
    loader: Comparison | None = None
    tallies: dict[str, Tally] = field(default_factory=dict)
    load_seconds: float = 0.0
    refused: str = ""

    @property
    def problems(self) -> list[str]:
        """Everything that is not explained, in words."""
        found = [f"{name}: {line}" for name, tally in self.tallies.items() for line in tally.unexplained]
        if self.loader is not None and not self.loader.is_equal:
            found.append(str(self.loader))
        return found


def check(ctx: moderngl.Context, case: Case, effort: Effort) -> Result:
    """Checks one stage."""
    result = Result(case)
    for name in effort.modes:
        start = time.process_time()
        try:
            scene = load_scene(case.path, LoadOptions(alpha=MODES[name], variants=case.variants))
        except Problem as problem:
            result.refused = str(problem).splitlines()[0]
            _check_nothing(case)
            return result
        if name == effort.modes[0]:
            result.load_seconds = time.process_time() - start
            result.loader = _compare(case, scene, effort)
        result.tallies[name] = _shoot(ctx, case, scene, effort)
    return result


def _check_nothing(case: Case) -> None:
    """Asserts that the second reader finds nothing either."""
    try:
        reading = StageReading(case.path, case.variants).read()
    except Tf.ErrorException:
        return
    assert not len(reading.triangles), f"the loader finds none of the meshes in {case.path}"
    assert not reading.gprims, f"the loader finds none of the gprims in {case.path}"


def _compare(case: Case, scene: SceneArrays, effort: Effort) -> Comparison | None:
    if scene.triangles > effort.pairs:
        return None
    reader = StageReading(case.path, case.variants)
    return compare(scene, reader.read(), reader.time)


def _shoot(ctx: moderngl.Context, case: Case, scene: SceneArrays, effort: Effort) -> Tally:
    gpu = GpuScene(ctx, scene)
    caster = Embree(scene) if scene.triangles <= effort.embree else None
    tally = Tally()
    for number, view in enumerate(case.cameras(scene, effort.views)):
        tally.add(shoot(gpu, caster, view, effort, number))
    return tally


def shoot(gpu: GpuScene, caster: Embree | None, view: View, effort: Effort, seed: int) -> Tally:
    """Compares a view of an uploaded scene with rays through a sample of its pixels.

    Args:
        gpu: The scene.
        caster: Embree's tree of it; without one only the exact rays are cast.
        view: The camera.
        effort: Size and number of pixels.
        seed: Decides which pixels.
    """
    frame = Frame(gpu, view, *effort.size)
    dump, walls = capture(frame).dump, opaque_depth(frame)
    pixels = _sample(dump, walls, effort.pixels, seed)
    camera = Camera.of(view, gpu.scene.bounds, *effort.size)
    hits = cast(gpu.scene, camera, pixels)
    found, strays, step = hits.inside, set[int](), 0.0
    if caster is not None:
        found, strays = met(hits, *caster.hits(camera, pixels))
        step = caster.step
    return judge(dump, walls, camera, pixels, hits, classify(gpu.scene, hits), found, strays, step)


def _sample(dump: FragmentDump, walls: NDArray[np.float32], count: int, seed: int) -> NDArray[np.int64]:
    """Half of the pixels anywhere, half where something was drawn: a missing surface shows in the first half."""
    rng = np.random.default_rng(seed)
    drawn = np.flatnonzero((dump.counts > 0) | np.isfinite(walls))
    chosen = [rng.choice(dump.pixels, min(count, dump.pixels), replace=False)]
    if len(drawn):
        chosen = [chosen[0][: len(chosen[0]) // 2], rng.choice(drawn, min(count // 2, len(drawn)), replace=False)]
    return np.unique(np.concatenate(chosen)).astype(np.int64)
