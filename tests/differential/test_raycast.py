"""Every scene, as loaded and as drawn, against a second reading of its stage and against rays (benchmarks/casting).

The same with more views and pixels, and with tables: `python -m benchmarks.raycast`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom
from support.scenes import SIZE, VIEW, shells

from benchmarks.casting.cases import Case, described_cases, sample_cases
from benchmarks.casting.check import Effort, check, shoot
from benchmarks.casting.embree import Embree, met
from benchmarks.casting.intervals import Intervals
from benchmarks.casting.loader import compare
from benchmarks.casting.matching import match
from benchmarks.casting.opacity import classify
from benchmarks.casting.rays import Camera, cast
from benchmarks.casting.reading import StageReading
from benchmarks.casting.verdict import Tally, judge
from renderer.capture import capture
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.opaque_depth import opaque_depth
from renderer.samples import SAMPLES
from renderer.samples.deep import DEEP
from renderer.scene import load_scene
from schemas.fragments import FragmentDump
from schemas.scene import SceneArrays
from schemas.view import View

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"
# Embree's trees and the pairing of millions of triangles are for the benchmark.
EFFORT = Effort(size=(160, 100), views=1, pixels=120, embree=200_000, pairs=300_000)
ORTHOGRAPHIC = View(name="above", eye=(1.0, 4.0, 2.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0), ortho_height=4.5)


def described() -> list[Case]:
    return described_cases(SCENES) if (SCENES / "MANIFEST.json").exists() else []


def effort(case: Case, stages: int) -> Effort:
    """Large stages, and those of a scene that has many, are looked at in one mode: loading them is most of the work."""
    if stages > 10:
        return replace(EFFORT, size=(64, 48), pixels=40, modes=EFFORT.modes[:1])
    return replace(EFFORT, modes=EFFORT.modes[:1]) if (case.triangles or 0) > EFFORT.pairs else EFFORT


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Case]:
    return {case.scene: case for case in sample_cases(tmp_path_factory.mktemp("samples"))}


@pytest.mark.parametrize("name", SAMPLES)
def test_own_scenes_are_what_rays_see(gl: moderngl.Context, samples: dict[str, Case], name: str) -> None:
    result = check(gl, samples[name], EFFORT)
    assert result.problems == []
    assert all(tally.fragments > 0 for tally in result.tallies.values())


@pytest.mark.parametrize("name", ["anatomy", "fur", "fountain", "marbles", "turbofan", "cloudscape"])
def test_own_deep_scenes_are_what_rays_see(gl: moderngl.Context, tmp_path: Path, name: str) -> None:
    few = replace(EFFORT, size=(96, 64), pixels=40, modes=EFFORT.modes[:1])  # loading is most of the work
    result = check(gl, Case(name, DEEP[name](tmp_path)), few)
    assert result.problems == []
    assert result.tallies["alpha .33"].fragments > 0


@pytest.mark.skipif(not described(), reason="the scenes are not here")
@pytest.mark.parametrize("scene", sorted({case.scene for case in described()}))
def test_scenes_are_what_rays_see(gl: moderngl.Context, scene: str) -> None:
    cases = [case for case in described() if case.scene == scene]
    results = [check(gl, case, effort(case, len(cases))) for case in cases]
    assert [problem for result in results for problem in result.problems] == []
    assert any(result.tallies for result in results), "something can be drawn"
    for result in results:
        if result.loader is not None and result.case.triangles is not None:
            assert result.loader.triangles == result.case.triangles


@pytest.mark.parametrize(
    "view", [VIEW, ORTHOGRAPHIC, VIEW.model_copy(update={"near": 3.9})], ids=lambda view: view.name
)
def test_views_of_every_kind_agree(gl: moderngl.Context, view: View) -> None:
    scene = shells()
    tally = shoot(GpuScene(gl, scene), Embree(scene), view, Effort(SIZE, pixels=2000), seed=1)
    assert tally.unexplained == []
    assert tally.equal > 0.95 * tally.pixels
    assert tally.reasons_embree["coincident"] > 0, "the shells are there twice"


class Checked:
    """A frame of the shells, its dump and rays, for finding out whether what is wrong with a dump is found."""

    def __init__(self, gl: moderngl.Context) -> None:
        self.scene = shells(duplicates=1)
        frame = Frame(GpuScene(gl, self.scene), VIEW, *SIZE)
        self.dump, self.walls = capture(frame).dump, opaque_depth(frame)
        self.camera = Camera.of(VIEW, self.scene.bounds, *SIZE)
        self.pixels = np.flatnonzero(self.dump.counts > 2)[::7]

    def judge(self, dump: FragmentDump, walls: np.ndarray, scene: SceneArrays | None = None) -> Tally:
        scene = scene or self.scene
        hits = cast(scene, self.camera, self.pixels)
        return judge(dump, walls, self.camera, self.pixels, hits, classify(scene, hits), hits.inside, set(), 0.0)


@pytest.fixture(scope="module")
def checked(gl: moderngl.Context) -> Checked:
    return Checked(gl)


def without_some(dump: FragmentDump) -> FragmentDump:
    kept = np.ones(dump.total, dtype=bool)
    kept[dump.offsets[:-1][dump.counts > 2]] = False
    counts = np.add.reduceat(np.append(kept, False).astype(np.int64), dump.offsets[:-1]) * (dump.counts > 0)
    offsets = np.concatenate([[0], np.cumsum(counts)])
    return replace(dump, offsets=offsets, rgba=dump.rgba[kept], depth=dump.depth[kept])


def deeper(dump: FragmentDump) -> FragmentDump:
    return replace(dump, depth=dump.depth * np.float32(1.0003))


@pytest.mark.parametrize("spoil", [without_some, deeper])
def test_wrong_fragments_are_found(checked: Checked, spoil: Callable[[FragmentDump], FragmentDump]) -> None:
    assert checked.judge(checked.dump, checked.walls).unexplained == []
    wrong = checked.judge(spoil(checked.dump), checked.walls)
    assert wrong.reasons["unexplained"] > 0.5 * len(checked.pixels)


def test_wrong_opaque_surfaces_are_found(checked: Checked) -> None:
    solid = np.isfinite(checked.walls[checked.pixels])
    wrong = checked.judge(checked.dump, checked.walls * np.float32(1.001))
    assert len(wrong.unexplained) >= int(solid.sum()) > 0


def test_fragments_of_triangles_that_are_not_there_are_found(checked: Checked) -> None:
    indices = checked.scene.indices.copy()
    indices[len(indices) // 2 :] = indices[0]
    wrong = checked.judge(checked.dump, checked.walls, replace(checked.scene, indices=indices))
    assert wrong.reasons["unexplained"] > 0.5 * len(checked.pixels)


def test_embree_and_exact_rays_meet_the_same_triangles(checked: Checked) -> None:
    hits = cast(checked.scene, checked.camera, checked.pixels)
    found, strays = met(hits, *Embree(checked.scene).hits(checked.camera, checked.pixels))
    assert not strays
    assert np.count_nonzero(found != hits.inside) <= 0.001 * len(found)
    assert hits.inside.sum() > 4 * len(checked.pixels)


def test_triangles_pair_up_in_any_order_and_from_any_corner() -> None:
    rng = np.random.default_rng(5)
    ours = rng.uniform(-1.0, 1.0, (500, 3, 3))
    ours[100:110] = ours[:10]
    order = rng.permutation(500)
    theirs = np.roll(ours[order], 1, axis=1) + rng.uniform(-1e-7, 1e-7, (500, 3, 3))
    left = match(ours, theirs, 2.0)
    assert len(left.ours) == len(left.theirs) == 0
    left = match(ours[:, ::-1], theirs, 2.0)
    assert len(left.ours) == 500, "the other winding is another triangle"
    moved = theirs.copy()
    moved[7] += 1e-3
    left = match(ours, np.concatenate([moved, moved[:1]]), 2.0)
    assert left.ours.tolist() == [order[7]]
    assert len(left.theirs) == 2


def test_loader_differences_are_found(samples: dict[str, Case]) -> None:
    case = samples["engine"]
    scene = load_scene(case.path)
    reader = StageReading(case.path)
    reading = reader.read()
    assert compare(scene, reading, reader.time).is_equal
    wrong = compare(replace(scene, positions=scene.positions * np.float32(1.001)), reading, reader.time)
    assert wrong.missing > 1000
    assert wrong.extra == wrong.missing


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
def test_concave_faces_must_be_tiled(tmp_path: Path, orientation: str) -> None:
    file = tmp_path / "arrow.usda"
    stage = Usd.Stage.CreateNew(str(file))
    mesh = UsdGeom.Mesh.Define(stage, "/Arrow")
    mesh.CreatePointsAttr([(-1.0, -1.0, 0.0), (0.0, -0.5, 0.0), (1.0, -1.0, 0.0), (0.0, 1.0, 0.0)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateOrientationAttr(orientation)
    stage.Save()
    scene, reader = load_scene(file), StageReading(file)
    reading = reader.read()
    good = compare(scene, reading, reader.time)
    assert good.is_equal
    assert (good.folded, good.cut) == (1, 2)
    places = scene.positions + scene.origin
    order = [int(np.argmin(np.linalg.norm(places - corner, axis=1))) for corner in reading.folded[0]]
    fan = np.array([[order[0], order[1], order[2]], [order[0], order[2], order[3]]], dtype=np.uint32)
    assert compare(replace(scene, indices=fan.ravel()), reading, reader.time).wrong


def test_gprims_must_lie_on_their_surface_and_be_closed(tmp_path: Path) -> None:
    file = tmp_path / "gprims.usda"
    stage = Usd.Stage.CreateNew(str(file))
    for number, kind in enumerate(("Cube", "Sphere", "Cylinder", "Cone", "Capsule", "Plane")):
        prim = stage.DefinePrim(f"/{kind}", kind)
        UsdGeom.XformCommonAPI(prim).SetTranslate(Gf.Vec3d(5.0 * number, 0.0, 0.0))
        UsdGeom.XformCommonAPI(prim).SetScale(Gf.Vec3f(1.0, -2.0, 0.5))
    stage.Save()
    scene, reader = load_scene(file), StageReading(file)
    reading = reader.read()
    good = compare(scene, reading, reader.time)
    assert good.is_equal
    assert good.tessellated == good.ours > 1000
    open_scene = replace(scene, indices=scene.indices[: -3 * (scene.triangles // 3)])
    assert compare(open_scene, reading, reader.time).wrong
    dented = scene.positions.copy()
    dented[scene.indices[500]] *= np.float32(0.99)
    assert compare(replace(scene, positions=dented), reading, reader.time).extra > 0


def test_intervals_pair_with_depths_as_brute_force_says() -> None:
    rng = np.random.default_rng(2)
    for _ in range(200):
        depths = np.sort(rng.integers(0, 8, rng.integers(0, 5))).astype(np.float64)
        low = rng.integers(0, 8, rng.integers(0, 5)).astype(np.float64)
        intervals = Intervals(low, low + rng.integers(0, 3, len(low)))
        most = _most_pairs(depths.tolist(), list(zip(intervals.low.tolist(), intervals.high.tolist(), strict=True)))
        assert intervals.holds_all(depths) == (most == len(depths))
        assert intervals.all_held(depths) == (most == len(low))


def _most_pairs(depths: list[float], intervals: list[tuple[float, float]]) -> int:
    if not depths:
        return 0
    first, rest = depths[0], depths[1:]
    best = _most_pairs(rest, intervals)
    for k, (low, high) in enumerate(intervals):
        if low <= first <= high:
            best = max(best, 1 + _most_pairs(rest, intervals[:k] + intervals[k + 1 :]))
    return best
