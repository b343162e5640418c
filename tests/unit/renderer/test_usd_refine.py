"""Subdivision surfaces against a plain twin, closed forms and invariants."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from support.stages import stage, world
from support.subdivision import Mesh, edges_of, level, with_boundaries

from renderer.scene import LoadOptions, load_scene
from renderer.usd.refine import refine
from renderer.usd.sharpness import Cage
from schemas.problem import Problem

CUBE = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
CORNERS = np.array([[x, y, z] for z in (-1.0, 1.0) for y in (-1.0, 1.0) for x in (-1.0, 1.0)])


def cage(faces: list[list[int]], points: int, **extra: object) -> Cage:
    counts = np.array([len(f) for f in faces])
    return Cage(points, counts, np.array([p for f in faces for p in f]), **extra)  # type: ignore[arg-type]


def grid(width: int, height: int) -> list[list[int]]:
    row = width + 1
    return [
        [y * row + x, y * row + x + 1, (y + 1) * row + x + 1, (y + 1) * row + x]
        for y in range(height)
        for x in range(width)
    ]


@st.composite
def meshes(draw: st.DrawFn) -> tuple[Mesh, str]:
    """Parts of a grid, of a solid or of several, some faces split into triangles, with creases and corners."""
    scheme = draw(st.sampled_from(["catmullClark", "loop", "bilinear"]))
    faces = draw(st.sampled_from([CUBE, grid(2, 2), grid(3, 2), [[0, 1, 2, 3, 4], [1, 0, 5, 6]], grid(1, 1)]))
    faces = [f for f in faces if draw(st.integers(0, 5)) > 0] or [faces[0]]
    split = [[f[:3], [f[0], *f[2:]]] if len(f) > 3 and draw(st.booleans()) else [f] for f in faces]
    faces = [part for parts in split for part in parts]
    if scheme == "loop":
        faces = [[f[0], f[i], f[i + 1]] for f in faces for i in range(1, len(f) - 1)]
    count = max(p for f in faces for p in f) + 1
    seed = draw(st.integers(0, 2**32 - 1))
    points = list(np.random.default_rng(seed).normal(size=(count, 3)))
    mesh = Mesh(points, faces)
    sharpness = st.sampled_from([0.3, 1.0, 1.7, 2.0, 10.0])
    edges = list(edges_of(mesh))
    mesh.edges = {e: draw(sharpness) for e in draw(st.lists(st.sampled_from(edges), max_size=5, unique=True))}
    mesh.corners = {p: draw(sharpness) for p in draw(st.lists(st.integers(0, count - 1), max_size=2, unique=True))}
    return mesh, scheme


def plain(mesh: Mesh, scheme: str, boundary: str, levels: int) -> Mesh:
    def forever(sharpnesses: dict) -> dict:  # type: ignore[type-arg]
        return {k: (np.inf if s >= 10.0 else s) for k, s in sharpnesses.items()}

    mesh = with_boundaries(Mesh(mesh.points, mesh.faces, forever(mesh.edges), forever(mesh.corners)), boundary)
    for _ in range(levels):
        mesh = level(mesh, scheme)
    return mesh


@given(meshes(), st.sampled_from(["edgeOnly", "edgeAndCorner"]), st.integers(1, 3))
@settings(max_examples=60, deadline=None)
def test_refined_meshes_are_those_of_the_plain_twin(drawn: tuple[Mesh, str], boundary: str, levels: int) -> None:
    mesh, scheme = drawn
    fine = refine(
        cage(
            mesh.faces,
            len(mesh.points),
            boundary=boundary,
            creases=np.array([p for e in mesh.edges for p in e], dtype=np.int64),
            crease_lengths=np.full(len(mesh.edges), 2),
            crease_sharpnesses=np.array(list(mesh.edges.values())),
            corner_points=np.array(list(mesh.corners), dtype=np.int64),
            corner_sharpnesses=np.array(list(mesh.corners.values())),
        ),
        scheme,
        levels,
    )
    expected = plain(mesh, scheme, boundary, levels)
    np.testing.assert_array_equal(np.split(fine.corners, np.cumsum(fine.counts)[:-1]), expected.faces)
    np.testing.assert_allclose(fine.vertex(np.array(mesh.points)), np.array(expected.points), atol=1e-12)


@given(meshes(), st.integers(1, 2))
@settings(max_examples=30, deadline=None)
def test_weights_sum_to_one_so_that_refinement_moves_with_its_cage(drawn: tuple[Mesh, str], levels: int) -> None:
    mesh, scheme = drawn
    fine = refine(cage(mesh.faces, len(mesh.points)), scheme, levels)
    rng = np.random.default_rng(5)
    linear, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    points = np.array(mesh.points)
    corner_values = rng.normal(size=(sum(map(len, mesh.faces)), 3))
    for spread, values in ((fine.vertex, points), (fine.varying, points), (fine.face_varying, corner_values)):
        np.testing.assert_allclose(spread(values @ linear + shift), spread(values) @ linear + shift, atol=1e-10)


def test_a_cube_has_the_points_that_catmull_and_clark_give() -> None:
    fine = refine(cage(CUBE, 8), "catmullClark", 1)
    points = fine.vertex(CORNERS)
    # Corners: (F + 2 R + 0 P) / 3 with F = 1/3, R = 2/3; edges: mean of two ends and two faces; faces: middle.
    np.testing.assert_allclose(np.abs(points[:8]), 5 / 9)
    np.testing.assert_allclose(np.sort(np.abs(points[8:20]), axis=1), np.tile([0, 0.75, 0.75], (12, 1)), atol=1e-15)
    np.testing.assert_allclose(np.sort(np.abs(points[20:]), axis=1), np.tile([0, 0, 1], (6, 1)), atol=1e-15)
    body = trimesh.Trimesh(points, np.concatenate([fine.corners.reshape(-1, 4)[:, [0, i, i + 1]] for i in (1, 2)]))
    assert body.is_watertight
    assert body.volume > 0


def test_a_cube_with_sharp_edges_stays_a_cube() -> None:
    edges = sorted({tuple(sorted((f[i - 1], f[i]))) for f in CUBE for i in range(4)})
    creases = np.array(edges).ravel()
    sharp = {"creases": creases, "crease_lengths": np.full(12, 2), "crease_sharpnesses": np.array([10.0])}
    one_each = {**sharp, "crease_sharpnesses": np.full(12, 10.0)}
    fine = refine(cage(CUBE, 8, **one_each), "catmullClark", 3)
    np.testing.assert_allclose(np.abs(fine.vertex(CORNERS)).max(axis=1), 1.0)
    # Sharpnesses that fit neither the creases nor their edges say nothing.
    round_again = refine(cage(CUBE, 8, **sharp), "catmullClark", 3)
    np.testing.assert_allclose(round_again.vertex(CORNERS), refine(cage(CUBE, 8), "catmullClark", 3).vertex(CORNERS))


def test_a_chain_of_creases_takes_one_sharpness_or_one_for_each_edge() -> None:
    chain = {"creases": np.array([0, 1, 3, 2, 0]), "crease_lengths": np.array([5])}
    one = refine(cage(CUBE, 8, **chain, crease_sharpnesses=np.array([2.5])), "catmullClark", 2)
    each = refine(cage(CUBE, 8, **chain, crease_sharpnesses=np.full(4, 2.5)), "catmullClark", 2)
    np.testing.assert_array_equal(one.vertex(CORNERS), each.vertex(CORNERS))
    assert not np.allclose(one.vertex(CORNERS), refine(cage(CUBE, 8), "catmullClark", 2).vertex(CORNERS))


@pytest.mark.parametrize("scheme", ["catmullClark", "bilinear", "loop"])
def test_a_flat_grid_stays_flat_and_keeps_its_outline(scheme: str) -> None:
    faces = grid(3, 2)
    if scheme == "loop":
        faces = [part for a, b, c, d in faces for part in ([a, b, c], [a, c, d])]
    points = np.array([[x, y, 0.0] for y in range(3) for x in range(4)])
    fine = refine(cage(faces, 12), scheme, 3)
    places = fine.vertex(points)
    np.testing.assert_allclose(places[:, 2], 0.0, atol=1e-15)
    np.testing.assert_allclose([places.min(axis=0), places.max(axis=0)], [[0, 0, 0], [3, 2, 0]], atol=1e-12)
    assert len(fine.counts) == len(faces) * 4**3


def test_boundaries_that_are_not_interpolated_leave_the_inner_faces() -> None:
    points = np.array([[x, y, 0.0] for y in range(5) for x in range(5)])
    fine = refine(cage(grid(4, 4), 25, boundary="none"), "catmullClark", 1)
    drawn = np.setdiff1d(np.unique(fine.parents), np.unique(fine.parents[fine.holes]))
    np.testing.assert_array_equal(drawn, [5, 6, 9, 10])
    edge_only = refine(cage(grid(4, 4), 25, boundary="edgeOnly"), "catmullClark", 1)
    np.testing.assert_allclose(edge_only.vertex(points)[0], [0.125, 0.125, 0.0])


def test_holes_and_slivers_keep_their_place_in_the_order() -> None:
    fine = refine(
        Cage(9, np.array([4, 2, 4, 4, 4]), np.array([0, 1, 4, 3, 0, 1, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7]),
             holes=np.array([2])),
        "catmullClark", 1,
    )  # fmt: skip
    np.testing.assert_array_equal(fine.parents, np.repeat([0, 2, 3, 4], 4))
    np.testing.assert_array_equal(fine.parents[fine.holes], [2] * 4)
    np.testing.assert_array_equal(fine.authored_corners, [0, 1, 2, 3, *range(6, 18)])


def test_schemes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="loop needs triangles"):
        refine(cage(CUBE, 8), "loop", 1)
    with pytest.raises(ValueError, match="not known"):
        refine(cage(CUBE, 8), "butterfly", 1)
    with pytest.raises(Problem, match="faces of one mesh"):
        refine(cage(CUBE, 8), "catmullClark", 20)


SHEET = """
def Mesh "Sheet"
{
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (1, 1, 0), (2, 1, 0)]
    uniform token subdivisionScheme = "%s"
    %s
}
"""


def test_refining_a_file_makes_more_triangles_of_cages_only(tmp_path: Path) -> None:
    file = stage(tmp_path, SHEET % ("catmullClark", ""))
    assert load_scene(file).triangles == 4
    assert [load_scene(file, LoadOptions(refine=n)).triangles for n in (1, 2)] == [16, 64]
    polygons = stage(tmp_path, SHEET % ("none", ""), name="polygons.usda")
    assert load_scene(polygons, LoadOptions(refine=2)).triangles == 4
    quads = load_scene(stage(tmp_path, SHEET % ("loop", ""), name="loop.usda"), LoadOptions(refine=2))
    assert quads.triangles == 4
    assert any("/Sheet" in line and "loop" in line for line in quads.warnings)
    for wrong in (-1, 99):
        with pytest.raises(Problem, match="Refining"):
            LoadOptions(refine=wrong)


@pytest.mark.parametrize(
    ("interpolation", "values", "at_x"),
    [
        ("constant", [0.5], lambda x: 0.5),
        ("uniform", [0.2, 0.8], lambda x: np.where(x < 1, 0.2, 0.8)),
        ("varying", [0.2, 0.4, 0.6] * 2, lambda x: 0.2 + 0.2 * x),
        ("faceVarying", [0.2, 0.4, 0.4, 0.2, 0.6, 0.8, 0.8, 0.6], lambda x: np.where(x < 1, 0.2, 0.4) + 0.2 * x),
    ],
)
def test_primvars_follow_the_refined_surface(
    tmp_path: Path, interpolation: str, values: list[float], at_x: object
) -> None:
    extra = f'float[] primvars:displayOpacity = {values} ( interpolation = "{interpolation}" )'
    scene = load_scene(stage(tmp_path, SHEET % ("bilinear", extra)), LoadOptions(refine=2))
    corners = scene.indices.reshape(-1, 3)
    places, alpha = world(scene), scene.colours[corners][..., 3]
    inside = places.mean(axis=1)[:, 0]
    if interpolation in ("uniform", "faceVarying"):
        # On the seam the value depends on the face.
        x = np.clip(
            places[..., 0], np.where(inside < 1, 0, 1 + 1e-9)[:, None], np.where(inside < 1, 1 - 1e-9, 2)[:, None]
        )
    else:
        x = places[..., 0]
    np.testing.assert_allclose(alpha, np.broadcast_to(at_x(x), alpha.shape) * 255, atol=0.51)  # type: ignore[operator]


def test_vertex_primvars_are_smoothed_like_points(tmp_path: Path) -> None:
    # The red channel is the x coordinate over 2: it must stay so after any smoothing.
    values = [(x / 2, 0, 0) for x in (0, 1, 2, 0, 1, 2)]
    extra = f'color3f[] primvars:displayColor = {values} ( interpolation = "vertex" )'
    text = SHEET.replace("(1, 1, 0)", "(1.5, 1, 0)").replace("(1, 0, 0)", "(0.5, 0, 0)") % ("catmullClark", extra)
    text = text.replace("(0.5, 0, 0), (1.0, 0, 0), (0.0", "(0.25, 0, 0), (1.0, 0, 0), (0.0")
    text = text.replace("(0.5, 0, 0), (1.0, 0, 0)] (", "(0.75, 0, 0), (1.0, 0, 0)] (")
    scene = load_scene(stage(tmp_path, text), LoadOptions(refine=2))
    x = scene.positions[:, 0] + scene.origin[0]
    np.testing.assert_allclose((scene.colours[:, 0] / 255.0) ** 2, x / 2, atol=0.006)


def test_subsets_and_orientation_survive_refinement(tmp_path: Path) -> None:
    extra = """
    uniform token orientation = "leftHanded"
    rel material:binding = </Red>
    def GeomSubset "Half" ( prepend apiSchemas = ["MaterialBindingAPI"] ) {
        uniform token elementType = "face"
        uniform token familyName = "materialBind"
        int[] indices = [1]
        rel material:binding = </Green> }
    """
    looks = "".join(
        f'def Material "{name}" {{ token outputs:surface.connect = </{name}/S.outputs:surface>\n'
        f'def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"\n'
        f"color3f inputs:diffuseColor = ({colour})\ntoken outputs:surface }} }}\n"
        for name, colour in (("Red", "1, 0, 0"), ("Green", "0, 1, 0"))
    )
    mesh = SHEET.replace('"Sheet"', '"Sheet" ( prepend apiSchemas = ["MaterialBindingAPI"] )')
    scene = load_scene(stage(tmp_path, mesh % ("catmullClark", extra) + looks), LoadOptions(refine=2))
    corners = scene.indices.reshape(-1, 3)
    green = scene.colours[corners][:, 0, 1] > 0
    np.testing.assert_array_equal(green, world(scene).mean(axis=1)[:, 0] > 1)
    assert scene.normals[:, 2].max() < -0.99
