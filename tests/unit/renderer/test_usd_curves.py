"""BasisCurves as tubes and ribbons: segments, evaluation, frames, surfaces, primvars; Points as solids."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from pxr import Usd, UsdGeom, Vt
from support.stages import stage, world

from renderer.scene import load_scene
from renderer.usd.curves import BUDGET, DETAILS, detail, tube
from renderer.usd.frames import tangents, transported
from renderer.usd.points import icosahedron, octahedron
from renderer.usd.spline import BASES, sample, split
from schemas.problem import Problem
from schemas.scene import SceneArrays

KINDS = [("linear", "bezier")] + [("cubic", basis) for basis in ("bezier", "bspline", "catmullRom")]
WRAPS = ("nonperiodic", "periodic", "pinned")


def curves(
    folder: Path, extra: str = "", kind: str = "linear", points: str = "(0,0,0), (0,0,1), (0,0,3)"
) -> SceneArrays:
    count = points.count("(")
    body = f"""
def BasisCurves "Hair"
{{
    uniform token type = "{kind}"
    int[] curveVertexCounts = [{count}]
    point3f[] points = [{points}]
    {extra}
}}
"""
    return load_scene(stage(folder, body))


def solid(scene: SceneArrays) -> trimesh.Trimesh:
    return trimesh.Trimesh(scene.positions, scene.indices.reshape(-1, 3), process=False)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize(("kind", "basis"), KINDS)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_segments_and_sizes_are_those_of_usdgeom(kind: str, basis: str, wrap: str, data: st.DataObject) -> None:
    bezier = kind == "cubic" and basis == "bezier"
    least = {"periodic": 3, "pinned": 2}.get(wrap, 4) if kind == "cubic" else (3 if wrap == "periodic" else 2)
    raw = data.draw(st.lists(st.integers(0, 6), min_size=1, max_size=6))
    if bezier:
        counts = np.array([3 * n + (3 if wrap == "periodic" else 4) for n in raw])
    else:
        counts = np.array([least + n for n in raw])
    usd = Usd.Stage.CreateInMemory()
    prim = UsdGeom.BasisCurves.Define(usd, "/C")
    prim.CreateTypeAttr(kind)
    prim.CreateBasisAttr(basis)
    prim.CreateWrapAttr(wrap)
    prim.CreateCurveVertexCountsAttr(Vt.IntArray(counts.tolist()))
    spline = split(counts, kind, basis, wrap)
    segments = np.bincount(spline.curve, minlength=len(counts))
    np.testing.assert_array_equal(segments, prim.ComputeSegmentCounts(Usd.TimeCode.Default()))
    # UsdGeomBasisCurves' documentation; the function of that name does not know pinned and closed linear curves.
    assert spline.varying == segments.sum() + (0 if wrap == "periodic" else len(counts))
    if wrap != "pinned" and not (kind == "linear" and wrap == "periodic"):
        assert spline.varying == prim.ComputeVaryingDataSize(Usd.TimeCode.Default())
    assert spline.points == prim.ComputeVertexDataSize(Usd.TimeCode.Default())
    assert spline.knots.max() < spline.varying
    # A curve's segments use its own vertices only, and phantoms that are made of them.
    begin = np.cumsum(counts) - counts
    real = spline.segments[spline.segments < spline.points]
    owner = np.repeat(spline.curve, (spline.segments < spline.points).sum(axis=1))
    assert np.all((real >= begin[owner]) & (real < begin[owner] + counts[owner]))


def plain_point(basis: str, vertices: np.ndarray, t: float) -> np.ndarray:
    """The textbook form of each basis, one point at a time."""
    p0, p1, p2, p3 = vertices
    if basis == "bezier":
        for _ in range(3):
            vertices = (1 - t) * vertices[:-1] + t * vertices[1:]
        return np.asarray(vertices[0])
    if basis == "bspline":
        weights = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
        return np.asarray(sum(w * p for w, p in zip(weights, vertices, strict=True)) / 6)
    # Catmull and Rom: the Hermite curve from p1 to p2 with tangents (p2 - p0) / 2 and (p3 - p1) / 2.
    h = (2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, -2 * t**3 + 3 * t**2, t**3 - t**2)
    return np.asarray(h[0] * p1 + h[1] * (p2 - p0) / 2 + h[2] * p2 + h[3] * (p3 - p1) / 2)


@pytest.mark.parametrize("basis", ["bezier", "bspline", "catmullRom"])
def test_points_on_curves_are_those_of_the_textbooks(basis: str) -> None:
    points = np.random.default_rng(3).normal(size=(7, 3))
    spline = split(np.array([7]), "cubic", basis, "nonperiodic")
    samples = sample(spline, 5)
    step = 3 if basis == "bezier" else 1
    for place, segment, at in zip(samples.vertex(points), samples.segment, samples.at, strict=True):
        np.testing.assert_allclose(place, plain_point(basis, points[step * segment :][:4], at), atol=1e-12)


@pytest.mark.parametrize("basis", BASES)
def test_weights_sum_to_one_so_that_curves_move_with_their_points(basis: str) -> None:
    np.testing.assert_allclose(BASES[basis].sum(axis=1), [1, 0, 0, 0], atol=1e-15)


@pytest.mark.parametrize("basis", ["bspline", "catmullRom"])
@pytest.mark.parametrize("count", [2, 3, 6])
def test_pinned_curves_begin_and_end_at_their_points(basis: str, count: int) -> None:
    points = np.random.default_rng(count).normal(size=(count + 4, 3))
    samples = sample(split(np.array([4, count]), "cubic", basis, "pinned"), 3)
    places = samples.vertex(points)
    np.testing.assert_allclose(places[samples.ends[1]], points[[4, -1]], atol=1e-12)


@pytest.mark.parametrize("basis", ["bezier", "bspline", "catmullRom"])
def test_closed_curves_end_where_they_begin(basis: str) -> None:
    points = np.random.default_rng(1).normal(size=(6, 3))
    samples = sample(split(np.array([6]), "cubic", basis, "periodic"), 50)
    places = samples.vertex(points)
    gaps = np.linalg.norm(places[samples.links[:, 1]] - places[samples.links[:, 0]], axis=1)
    assert len(samples.links) == len(places)
    assert len(samples.ends) == 0
    assert gaps.max() < 0.2


def helix(turns: float, count: int) -> np.ndarray:
    angle = 2 * np.pi * turns * np.arange(count) / (count - 1)
    return np.stack((np.cos(angle), np.sin(angle), 0.3 * angle), axis=1)


def test_frames_stay_across_the_curve_and_do_not_twist() -> None:
    points = helix(2.0, 2001)
    samples = sample(split(np.array([len(points)]), "linear", "", "nonperiodic"), 1)
    ahead = tangents(samples, points)
    normal = transported(samples, points, ahead)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(np.einsum("ij,ij->i", normal, ahead), 0.0, atol=1e-12)
    # Rotation minimising: the normal changes along the tangent only.
    change = np.diff(normal, axis=0)
    sideways = np.linalg.norm(np.cross(change, 0.5 * (ahead[1:] + ahead[:-1])), axis=1)
    assert sideways[5:-5].max() < 1e-4 * np.linalg.norm(change, axis=1).max()


def test_the_frames_of_a_closed_curve_meet() -> None:
    angle = 2 * np.pi * np.arange(200) / 200
    knot = np.stack((np.cos(angle), np.sin(angle), 0.5 * np.sin(3 * angle)), axis=1)
    samples = sample(split(np.array([200]), "linear", "", "periodic"), 1)
    ahead = tangents(samples, knot)
    normal = transported(samples, knot, ahead)
    jumps = np.linalg.norm(normal[samples.links[:, 1]] - normal[samples.links[:, 0]], axis=1)
    assert jumps[-1] < 1.5 * np.median(jumps)


def test_a_curve_with_widths_is_a_closed_tube(tmp_path: Path) -> None:
    scene = curves(tmp_path, 'float[] widths = [0.2] ( interpolation = "constant" )')
    body = solid(scene)
    body.merge_vertices(merge_norm=True, merge_tex=True)
    assert body.is_watertight
    assert body.volume == pytest.approx(np.pi * 0.1**2 * 3, rel=0.02)
    around = body.area - 2 * np.pi * 0.1**2
    assert around == pytest.approx(2 * np.pi * 0.1 * 3, rel=0.02)
    normals = scene.normals[scene.indices.reshape(-1, 3)]
    assert np.all(np.einsum("tki,ti->tk", normals, body.face_normals) > 0.5)
    assert scene.warnings == ("no material and no display colour, grey is used: /Hair",)


@pytest.mark.parametrize("sides", [3, 4, 8])
def test_the_mean_silhouette_of_a_tube_is_as_wide_as_the_curve(sides: int) -> None:
    samples = sample(split(np.array([2]), "linear", "", "nonperiodic"), 1)
    strip = tube(samples, np.array([[0.0, 0, 0], [0, 0, 1]]), np.full((2, 1), 0.5), sides)
    angle = np.linspace(0, np.pi, 721)
    seen = strip.points[:, :1] * np.cos(angle) + strip.points[:, 1:2] * np.sin(angle)
    assert np.ptp(seen, axis=0).mean() == pytest.approx(0.5, rel=1e-3)


def test_widths_vary_along_the_curve_at_every_interpolation(tmp_path: Path) -> None:
    for interpolation in ("varying", "vertex"):
        extra = f'float[] widths = [0.4, 0.2, 0] ( interpolation = "{interpolation}" )'
        corners = world(curves(tmp_path, extra)).reshape(-1, 3)
        for z, radius in ((0.0, 0.2), (1.0, 0.1), (3.0, 0.0)):
            across = np.linalg.norm(corners[np.isclose(corners[:, 2], z)][:, :2], axis=1)
            np.testing.assert_allclose(across.max(), radius, rtol=0.03, atol=1e-7)
    cubic = 'float[] widths = [0.4, 0.2] ( interpolation = "varying" )\nuniform token basis = "bezier"'
    corners = world(curves(tmp_path, cubic, "cubic", "(0,0,0), (0,0,1), (0,0,2), (0,0,3)")).reshape(-1, 3)
    middle = corners[np.isclose(corners[:, 2], 1.5)]
    np.testing.assert_allclose(np.linalg.norm(middle[:, :2], axis=1).max(), 0.15, rtol=0.03)


def test_primvars_widths_wins_over_widths(tmp_path: Path) -> None:
    extra = 'float[] widths = [9] ( interpolation = "constant" )\nfloat[] primvars:widths = [0.2]'
    size = np.ptp(world(curves(tmp_path, extra)).reshape(-1, 3), axis=0)
    np.testing.assert_allclose(size, [0.2, 0.2, 3.0], rtol=0.03)


def test_curves_without_widths_are_thin_and_a_warning(tmp_path: Path) -> None:
    scene = curves(tmp_path)
    assert any("no widths" in line and "/Hair" in line for line in scene.warnings)
    assert 0.001 < np.ptp(scene.positions[:, 0]) < 0.01


def test_a_curve_with_normals_is_a_ribbon_that_faces_along_them(tmp_path: Path) -> None:
    extra = """
    float[] widths = [0.5] ( interpolation = "constant" )
    normal3f[] normals = [(0,1,0), (0,1,0), (0,1,0.7)] ( interpolation = "varying" )"""
    scene = curves(tmp_path, extra)
    assert scene.triangles == 4
    np.testing.assert_allclose(np.ptp(scene.positions, axis=0), [0.5, 0.0, 3.0], atol=1e-6)
    np.testing.assert_allclose(scene.normals, np.tile([0.0, 1.0, 0.0], (len(scene.normals), 1)), atol=1e-6)
    np.testing.assert_allclose(solid(scene).face_normals, np.tile([0.0, 1.0, 0.0], (4, 1)), atol=1e-6)


TWO = """
def BasisCurves "Hair"
{
    uniform token type = "cubic"
    uniform token basis = "bezier"
    int[] curveVertexCounts = [4, 7]
    point3f[] points = [(0,0,0),(0,0,1),(0,0,2),(0,0,3), (5,0,0),(5,0,1),(5,0,2),(5,0,3),(5,0,4),(5,0,5),(5,0,6)]
    float[] widths = [0.1] ( interpolation = "constant" )
    float[] primvars:displayOpacity = %s ( interpolation = "%s" )
}
"""


@pytest.mark.parametrize(
    ("values", "interpolation", "expected"),
    [
        ([0.5], "constant", lambda x, z: 0.5),
        ([0.2, 0.6], "uniform", lambda x, z: 0.2 if x < 1 else 0.6),
        ([0.1, 0.4, 0.1, 0.4, 0.7], "varying", lambda x, z: 0.1 + 0.1 * z),
        ([0.1, 0.2, 0.3, 0.4, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7], "vertex", lambda x, z: 0.1 + 0.1 * z),
    ],
)
def test_primvars_reach_the_surface_at_every_interpolation(
    tmp_path: Path, values: list[float], interpolation: str, expected: object
) -> None:
    scene = load_scene(stage(tmp_path, TWO % (values, interpolation)))
    places = scene.positions + scene.origin
    wanted = [expected(x, z) * 255 for x, _, z in places]  # type: ignore[operator]
    np.testing.assert_allclose(scene.colours[:, 3], wanted, atol=0.51)
    assert not any("displayOpacity" in line for line in scene.warnings)


def test_subsets_of_curves_and_short_curves(tmp_path: Path) -> None:
    text = TWO.replace("[4, 7]", "[4, 3, 4]") % ("[0.5]", "constant")
    scene = load_scene(stage(tmp_path, text))
    assert any("too few points" in line and "/Hair" in line for line in scene.warnings)
    assert scene.triangles > 0


def test_curves_that_do_not_fit_are_left_out_with_a_warning(tmp_path: Path) -> None:
    text = TWO.replace("[4, 7]", "[4, 8]") % ("[0.5]", "constant")
    cube = 'def Cube "C" {}\n'
    scene = load_scene(stage(tmp_path, text + cube.replace("{}", "{\n}")))
    assert any("/Hair" in line and "do not add up" in line for line in scene.warnings)
    with pytest.raises(Problem, match="/Hair"):
        load_scene(stage(tmp_path, TWO.replace("(5,0,6)", "(5,0,nan)") % ("[0.5]", "constant")))


def test_many_curves_get_less_detail_and_keep_to_the_budget() -> None:
    few, many = (detail(split(np.full(n, 4), "cubic", "bspline", "nonperiodic")) for n in (10, 30_000))
    assert few == DETAILS[0]
    assert DETAILS[-1] != many != DETAILS[0]
    assert 30_000 * 2 * many[0] * many[1] <= BUDGET
    assert detail(split(np.full(10, 4), "linear", "", "nonperiodic"))[0] == 1


@pytest.mark.parametrize("make", [octahedron, icosahedron])
def test_solids_are_closed_and_have_the_surface_of_the_unit_sphere(make: object) -> None:
    body = make()  # type: ignore[operator]
    mesh = trimesh.Trimesh(body.points * body.scale, body.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume > 0
    assert mesh.area == pytest.approx(4 * np.pi)


def test_points_are_solids_of_their_widths_with_their_own_colours(tmp_path: Path) -> None:
    body = """
def Points "Dust"
{
    point3f[] points = [(0,0,0), (10,0,0)]
    float[] widths = [1, 2]
    color3f[] primvars:displayColor = [(1,0,0), (0,1,0)] ( interpolation = "vertex" )
}
"""
    scene = load_scene(stage(tmp_path, body))
    assert scene.triangles == 40
    corners = world(scene)
    for x, width, colour in ((0, 1.0, (255, 0, 0)), (10, 2.0, (0, 255, 0))):
        mine = np.abs(corners[:, 0, 0] - x) < 4
        assert np.ptp(corners[mine].reshape(-1, 3), axis=0) == pytest.approx([width] * 3, rel=0.15)
        np.testing.assert_array_equal(np.unique(scene.colours[scene.indices.reshape(-1, 3)[mine]][..., :3]), [0, 255])
        np.testing.assert_array_equal(scene.colours[scene.indices.reshape(-1, 3)[mine][0, 0], :3], colour)


def test_points_without_positions_are_a_warning(tmp_path: Path) -> None:
    scene = load_scene(stage(tmp_path, 'def Points "None" {\n}\ndef Cube "C" {\n}\n'))
    assert any("the points are empty: /None" in line for line in scene.warnings)
