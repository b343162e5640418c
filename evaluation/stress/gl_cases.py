"""The pictures that every technique renders: stacks of all kinds, ties everywhere, slanted triangles, any scale."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from evaluation.stress.findings import Options
from evaluation.stress.gl_stacks import (
    VIEW,
    Stack,
    awkward_stacks,
    extreme_stacks,
    screen_of_ties,
    size,
    stack_scene,
)
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.programs import Programs
from schemas.fragments import FragmentDump
from schemas.scene import Batch, SceneArrays
from schemas.view import View

MOST_LAYERS = 4096
"""Fragments of a pixel, at most (METHOD.md section 6)."""
LAYERS = 96
"""Where all budgets are tried, and where a geometry pass a layer is affordable."""

_SCALES = {"1e-30 m": 1e-30, "1e-10 m": 1e-10, "1e7 m": 1e7, "1e20 m": 1e20}
"""Of a scene that is else 10 m deep. Single precision flushes what is below 1e-38; a camera may be 1e20 m away."""


EVERY_BUDGET = ("0", "occupied - 1", "occupied", "N/3", "N - 1", "N", "2 N")
"""F that METHOD.md section 6 lists, and one between."""


@dataclass(frozen=True, slots=True)
class Scenery:
    """A scene, its camera and what to do there.

    Attributes:
        name: Of the case.
        scene: Polygons with `corners` corners each, none of which shares a vertex with another.
        view: The camera.
        size: Width and height, pixels.
        stacks: Names of the stacks, from left to right; empty where there are none.
        corners: 3 or 4: of a polygon.
        budgets: Which F are tried; keys of `evaluation.stress.gl_techniques.BUDGETS`.
        deep: Whether pixels have thousands of fragments: too many for a pass a layer, and bounds are others.
    """

    name: str
    scene: SceneArrays
    view: View
    size: tuple[int, int]
    stacks: tuple[str, ...] = ()
    corners: int = 4
    budgets: tuple[str, ...] = ("0", "N/7")
    deep: bool = False


@dataclass(frozen=True, slots=True)
class Case:
    """A scenery that is being rendered.

    Attributes:
        scenery: What it is.
        frame: On the GPU.
        dump: Its fragments.
        pixels: int64 [M], those that are compared with a twin: of the equal pixels of a stack, one.
    """

    scenery: Scenery
    frame: Frame
    dump: FragmentDump
    pixels: NDArray[np.int64]

    @property
    def name(self) -> str:
        """As in the table: cases with the same bounds share rows, which name the worst one."""
        return f"n {MOST_LAYERS}" if self.scenery.deep else f"n up to {LAYERS}"

    def stack(self, pixel: int) -> str:
        """The stack at a pixel; empty where the scenery has none."""
        names = self.scenery.stacks
        return names[pixel % self.frame.width * len(names) // self.frame.width] if names else ""

    def place(self, pixel: int) -> str:
        """A pixel in words."""
        column, row = pixel % self.frame.width, pixel // self.frame.width
        stack = f"{self.stack(pixel)}, " if self.scenery.stacks else ""
        return f"{self.scenery.name}: {stack}pixel ({column}, {row})"


def sceneries(options: Options) -> Iterator[Scenery]:
    """What is rendered, the deep one last."""
    seed = options.seed
    yield _ties(options)
    yield _holes(seed)
    yield _triangles(seed)
    scales = list(_SCALES.items())[:: 3 if options.quick else 1]
    yield from (_scaled(name, factor, seed) for name, factor in scales)
    yield _ratio(seed)
    yield _stacks({**extreme_stacks(LAYERS, seed), **awkward_stacks(LAYERS, seed)}, LAYERS, EVERY_BUDGET, seed)
    deep = extreme_stacks(MOST_LAYERS, seed)
    if options.quick:
        yield _stacks(deep, MOST_LAYERS, ("0", "N/64"), seed)
    else:
        yield _stacks({**deep, **awkward_stacks(MOST_LAYERS, seed)}, MOST_LAYERS, ("0", "N/64", "N/7"), seed)


def make_case(ctx: moderngl.Context, scenery: Scenery, programs: Programs) -> Case:
    """Upload and capture a scenery; shaders are compiled once for all of them."""
    gpu = GpuScene(ctx, scenery.scene)
    gpu.programs = programs
    frame = Frame(gpu, scenery.view, *scenery.size, float_sums=True)
    dump = capture(frame).dump
    occupied = np.flatnonzero(dump.counts)
    # The pixels of a stack have the same list but for highlights: one of each, and some more, are enough.
    pixels = np.union1d(_one_a_stack(scenery, occupied), occupied[::5]) if scenery.stacks else occupied
    return Case(scenery, frame, dump, np.union1d(pixels, np.flatnonzero(dump.counts == 0)[:4]))


def thinned(dump: FragmentDump, pixels: NDArray[np.integer]) -> FragmentDump:
    """The same picture without the fragments of all other pixels: twins are slow.

    Args:
        dump: A view.
        pixels: Integers, indices of the pixels that keep their fragments.
    """
    kept_pixel = np.zeros(dump.pixels, dtype=bool)
    kept_pixel[pixels] = True
    kept = np.repeat(kept_pixel, dump.counts)
    offsets = np.concatenate([[0], np.cumsum(np.where(kept_pixel, dump.counts, 0))]).astype(np.int64)
    return replace(dump, offsets=offsets, rgba=dump.rgba[kept], depth=dump.depth[kept])


def _one_a_stack(scenery: Scenery, occupied: NDArray[np.integer]) -> NDArray[np.integer]:
    column = occupied % scenery.size[0] * len(scenery.stacks) // scenery.size[0]
    return occupied[np.unique(column, return_index=True)[1]]


def _stacks(stacks: dict[str, Stack], layers: int, budgets: tuple[str, ...], seed: int) -> Scenery:
    return Scenery(
        name="stacks" if layers <= LAYERS else "deep stacks",
        scene=stack_scene(stacks, seed=seed),
        view=VIEW,
        size=size(len(stacks)),
        stacks=tuple(stacks),
        budgets=budgets,
        deep=layers > LAYERS,
    )


def _holes(seed: int) -> Scenery:
    """Opacities 0 and 1 between others: nothing, and what ends a list."""
    rng = np.random.default_rng(seed + 7)
    layers = 48
    alphas = rng.choice([0, 0, 1, 128, 254, 255], (6, layers), p=[0.3, 0.1, 0.2, 0.2, 0.15, 0.05])
    alphas[0], alphas[1] = 0, 255
    alphas[2] = [0] * (layers - 1) + [1]
    alphas[3] = [254] * (layers - 1) + [255]
    names = ("alpha 0 only", "alpha 255 only", "one of alpha 1", "alpha 254 over 255", "any alpha", "any alpha 2")
    stacks = {
        name: Stack(rng.permutation(np.linspace(10.0, 20.0, layers)) if i > 3 else np.linspace(10.0, 20.0, layers), a)
        for i, (name, a) in enumerate(zip(names, alphas, strict=True))
    }
    scene = stack_scene(stacks, holes=True, seed=seed)
    return Scenery("alpha 0 and 1", scene, VIEW, size(len(stacks)), names)


def _ties(options: Options) -> Scenery:
    width, height = (12, 8) if options.quick else (24, 16)
    scene = screen_of_ties(width, height, layers=24, depths=3, seed=options.seed)
    return Scenery("ties everywhere", scene, VIEW, (width, height), budgets=EVERY_BUDGET)


def _scaled(name: str, factor: float, seed: int) -> Scenery:
    stacks = extreme_stacks(24, seed)
    scene = stack_scene(stacks, seed=seed)
    positions = scene.positions.astype(np.float64) * factor
    bounds = np.stack([positions.min(axis=0), positions.max(axis=0)])
    scene = replace(scene, positions=positions.astype(np.float32), bounds=bounds)
    return Scenery(f"lengths of {name}", scene, VIEW, size(len(stacks)), tuple(stacks))


def _ratio(seed: int) -> Scenery:
    """Depths from 1 mm to 10 km: a camera sees four of those seven decades, whatever near plane it asks for."""
    rng = np.random.default_rng(seed + 8)
    n = 70
    stacks = {
        "seven decades": Stack(np.geomspace(1e-3, 1e4, n), rng.integers(1, 255, n)),
        "both ends": Stack(np.where(np.arange(n) % 2, 1e4, 1.5) * (1 + 1e-6 * np.arange(n)), rng.integers(1, 20, n)),
    }
    view = VIEW.model_copy(update={"near": 1e-3, "far": 1e4})
    return Scenery("far / near of 1e7", stack_scene(stacks, seed=seed), view, size(len(stacks)), tuple(stacks))


def _triangles(seed: int) -> Scenery:
    """Slanted triangles around and behind the eye, which the near plane cuts."""
    rng = np.random.default_rng(seed + 11)
    count = 90
    corners = rng.uniform(-1.0, 1.0, (count, 1, 3)) * [2.0, 1.5, 2.0] + rng.uniform(-0.9, 0.9, (count, 3, 3))
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    colours = np.concatenate([rng.integers(0, 256, (count, 3)), rng.choice([1, 84, 128, 254], (count, 1))], axis=1)
    positions = corners.reshape(-1, 3)
    scene = SceneArrays(
        name="triangles",
        positions=positions.astype(np.float32),
        normals=np.repeat(face, 3, axis=0).astype(np.float32),
        uvs=np.zeros((3 * count, 2), np.float32),
        colours=np.repeat(colours, 3, axis=0).astype(np.uint8),
        indices=np.arange(3 * count, dtype=np.uint32),
        batches=(Batch(first=0, count=3 * count, layer="transparent"),),
        textures=(),
        origin=np.zeros(3),
        bounds=np.stack([positions.min(axis=0), positions.max(axis=0)]),
        up=(0.0, 1.0, 0.0),
        metres_per_unit=1.0,
    )
    view = View(name="triangles", eye=(0.3, 0.4, 1.5), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov=80.0)
    return Scenery("slanted triangles", scene, view, (33, 24), corners=3)
