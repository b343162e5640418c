"""Triangulation, normals and primvars of meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.stages import stage, world

from renderer.scene import load_scene
from renderer.usd.topology import Attribute, triangulate
from renderer.usd.weld import weld
from schemas.colour import encode_gamma2

QUADS = """
def Mesh "Quads" %s
{
    int[] faceVertexCounts = [4, 4]
    int[] faceVertexIndices = [0, 1, 4, 3, 1, 2, 5, 4]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (2, 0, 1), (0, 1, 0), (1, 1, 0), (2, 1, 1)]
    uniform token subdivisionScheme = "%s"
    %s
}
"""


def quads(folder: Path, extra: str = "", scheme: str = "none", meta: str = "") -> Path:
    return stage(folder, QUADS % (meta, scheme, extra))


def test_n_gons_become_fans_and_holes_and_slivers_are_left_out() -> None:
    topology = triangulate(
        9, np.array([5, 2, 3, 4]), np.array([0, 1, 2, 3, 4, 0, 1, 4, 5, 6, 5, 6, 7, 8]), holes=np.array([2, 99])
    )
    np.testing.assert_array_equal(
        topology.corners[topology.triangles], [[0, 1, 2], [0, 2, 3], [0, 3, 4], [5, 6, 7], [5, 7, 8]]
    )
    np.testing.assert_array_equal(topology.face_of_triangle, [0, 0, 0, 3, 3])


@pytest.mark.parametrize(("counts", "corners"), [([3], [0, 1]), ([3], [0, 1, 3]), ([3], [0, 1, -1]), ([-3], [])])
def test_topology_that_does_not_fit_is_refused(counts: list[int], corners: list[int]) -> None:
    with pytest.raises(ValueError, match="faceVertex"):
        triangulate(3, np.array(counts), np.array(corners, dtype=np.int64))


def test_values_of_faces_cannot_be_kept_at_points() -> None:
    topology = triangulate(3, np.array([3]), np.array([0, 1, 2]))
    with pytest.raises(ValueError, match="uniform"):
        topology.spread(Attribute(np.zeros((1, 3), np.float32), "uniform"), "vertex")


def test_broken_topology_is_a_warning_and_the_rest_is_drawn(tmp_path: Path) -> None:
    broken = QUADS.replace("Quads", "Broken").replace("[4, 4]", "[4, 5]") % ("", "none", "")
    file = stage(tmp_path, QUADS % ("", "none", "") + broken)
    scene = load_scene(file)
    assert scene.triangles == 4
    assert any("/Broken" in w for w in scene.warnings)


def test_left_handed_meshes_are_turned_outside_out(tmp_path: Path) -> None:
    a, b, c = world(load_scene(quads(tmp_path, 'uniform token orientation = "leftHanded"')))[0]
    assert np.cross(b - a, c - a)[2] < 0


def test_cages_are_smooth_polygons_creased_beyond_thirty_degrees(tmp_path: Path) -> None:
    # A fold of 27 degrees: both faces are within 30 degrees of the mean, which the triangles that meet there weigh.
    for scheme in ("catmullClark", "none"):
        text = quads(tmp_path, scheme=scheme).read_text()
        (tmp_path / "fold.usda").write_text(
            text.replace("(2, 0, 1)", "(2, 0, 0.5)").replace("(2, 1, 1)", "(2, 1, 0.5)")
        )
        scene = load_scene(tmp_path / "fold.usda")
        at_fold = scene.normals[np.isclose(scene.positions[:, 0], 0.0)]
        assert len(at_fold) == 2
        np.testing.assert_allclose(at_fold, [_unit(-2, 0, 6), _unit(-1, 0, 6)], atol=1e-6)
    steep = quads(tmp_path).read_text().replace("(2, 0, 1)", "(1, 0, 1)").replace("(2, 1, 1)", "(1, 1, 1)")
    (tmp_path / "steep.usda").write_text(steep)
    normals = np.unique(load_scene(tmp_path / "steep.usda").normals.round(5) + 0.0, axis=0)
    np.testing.assert_allclose(normals, [[-1, 0, 0], [0, 0, 1]], atol=1e-5)


def _unit(*v: float) -> np.ndarray:
    return np.array(v) / np.linalg.norm(v)


@pytest.mark.parametrize(
    ("interpolation", "values"),
    [
        ("constant", "(0, 0, 3)"),
        ("uniform", "(0, 0, 3), (0, 0, 1)"),
        ("vertex", ", ".join(["(0, 0, 2)"] * 6)),
        ("faceVarying", ", ".join(["(0, 0, 2)"] * 8)),
    ],
)
def test_authored_normals_are_used_at_every_interpolation(tmp_path: Path, interpolation: str, values: str) -> None:
    extra = f'normal3f[] normals = [{values}] ( interpolation = "{interpolation}" )'
    normals = load_scene(quads(tmp_path, extra)).normals
    np.testing.assert_allclose(normals, np.tile([0.0, 0.0, 1.0], (len(normals), 1)))


def test_normals_of_the_wrong_number_are_a_warning_and_zero_ones_are_computed(tmp_path: Path) -> None:
    wrong = load_scene(quads(tmp_path, 'normal3f[] normals = [(0, 0, 1)] ( interpolation = "vertex" )'))
    assert any("/Quads" in w and "normals has 1 values" in w for w in wrong.warnings)
    zero = 'normal3f[] normals = [(0,0,0), (0,0,0)] ( interpolation = "uniform" )'
    normals = load_scene(quads(tmp_path, zero)).normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    assert normals[:, 0].min() < -0.7


COLOURS = {
    "constant": [[1, 0, 0]],
    "uniform": [[1, 0, 0], [0, 1, 0]],
    "vertex": [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]],
    "varying": [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, 1, 1], [1, 0, 1]],
    "faceVarying": [[0.1 * i, 0.5, 1 - 0.1 * i] for i in range(8)],
}


@pytest.mark.parametrize("interpolation", COLOURS)
@pytest.mark.parametrize("indexed", [False, True])
def test_display_colours_reach_the_corners_at_every_interpolation(
    tmp_path: Path, interpolation: str, indexed: bool
) -> None:
    values = COLOURS[interpolation]
    shown = values[::-1] if indexed else values
    text = ", ".join(str(tuple(v)) for v in shown)
    extra = f'color3f[] primvars:displayColor = [{text}] ( interpolation = "{interpolation}" )'
    if indexed:
        extra += f"\nint[] primvars:displayColor:indices = {list(range(len(values)))[::-1]}"
    scene = load_scene(quads(tmp_path, extra))
    corners = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    face_corners = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    rows = {
        "constant": np.zeros((4, 3), int),
        "uniform": np.array([[0] * 3, [0] * 3, [1] * 3, [1] * 3]),
        "faceVarying": face_corners,
    }.get(interpolation, corners)
    expected = encode_gamma2(np.array(values, dtype=np.float64)[rows])
    np.testing.assert_array_equal(scene.colours[scene.indices.reshape(-1, 3)][:, :, :3], expected)
    assert scene.warnings == ()


def test_opacity_decides_the_layer_of_each_triangle_and_invisible_ones_are_dropped(tmp_path: Path) -> None:
    def layers(values: str, interpolation: str) -> dict[str, int]:
        extra = f'float[] primvars:displayOpacity = [{values}] ( interpolation = "{interpolation}" )'
        scene = load_scene(quads(tmp_path, extra))
        return {batch.layer: batch.count // 3 for batch in scene.batches}

    assert layers("0.5, 1", "uniform") == {"opaque": 2, "transparent": 2}
    assert layers("0, 1", "uniform") == {"opaque": 2}
    # 0.999 is stored as 255 and 0.001 as 0: what is stored decides.
    assert layers("0.999, 0.001", "uniform") == {"opaque": 2}
    assert layers("1, 0.5, 0.5, 1, 0.5, 0.5", "vertex") == {"mixed": 2, "transparent": 2}


def test_degenerate_triangles_are_dropped(tmp_path: Path) -> None:
    text = quads(tmp_path).read_text().replace("(2, 0, 1)", "(1, 0, 0)")
    (tmp_path / "thin.usda").write_text(text)
    assert load_scene(tmp_path / "thin.usda").triangles == 3


def test_equal_corners_share_a_vertex(tmp_path: Path) -> None:
    flat = quads(tmp_path).read_text().replace("(2, 0, 1)", "(2, 0, 0)").replace("(2, 1, 1)", "(2, 1, 0)")
    (tmp_path / "flat.usda").write_text(flat)
    assert len(load_scene(tmp_path / "flat.usda").positions) == 6


def test_weld_keeps_first_rows_in_order_and_treats_both_zeros_alike() -> None:
    column = np.array([[0.0], [1.0], [-0.0], [2.0], [1.0]], dtype=np.float32)
    kept, number = weld((column,))
    np.testing.assert_array_equal(kept, [0, 1, 3])
    np.testing.assert_array_equal(number, [0, 1, 0, 2, 1])
