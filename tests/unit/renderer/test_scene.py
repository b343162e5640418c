"""Stages to arrays: errors, units, transforms, instances, visibility, time, variants."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdUtils
from support.stages import stage, triangle, world

from renderer.scene import LoadOptions, load_scene, scene_digest
from schemas.problem import ExitCode, Problem


@pytest.mark.parametrize(
    ("name", "content", "words", "code"),
    [
        ("absent.usda", None, "no file", ExitCode.NOT_FOUND),
        ("picture.png", b"PNG", "not a USD file", ExitCode.USAGE),
        ("empty.usda", b"", "is empty", ExitCode.USAGE),
        ("garbage.usda", b"\x00\xff" * 64, "cannot be read as USD", ExitCode.USAGE),
        ("garbage.usdc", b"PXR-USDC" + b"\x07" * 200, "cannot be read as USD", ExitCode.USAGE),
        ("garbage.usdz", b"PK\x03\x04" + b"\x07" * 200, "cannot be read as USD", ExitCode.USAGE),
        ("syntax.usda", b'#usda 1.0\ndef Mesh "a" {', "cannot be read as USD", ExitCode.USAGE),
        ("nothing.usda", b'#usda 1.0\ndef Xform "a" {}', "no geometry", ExitCode.USAGE),
    ],
)
def test_bad_files_are_problems_that_name_the_file(
    tmp_path: Path, name: str, content: bytes | None, words: str, code: ExitCode
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(Problem, match=words) as caught:
        load_scene(tmp_path / name)
    assert caught.value.code == code
    assert name in caught.value.title
    assert caught.value.remedy


def test_a_name_that_is_no_utf_8_is_a_problem(tmp_path: Path) -> None:
    file = tmp_path / os.fsdecode(b"n\xff.usda")
    file.write_text("#usda 1.0\n", encoding="utf-8")
    with pytest.raises(Problem, match=r"n\?\.usda is no UTF-8") as caught:
        load_scene(file)
    caught.value.title.encode()


def test_a_folder_is_a_problem(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="is a folder"):
        load_scene(tmp_path)


@pytest.mark.parametrize("number", ["nan", "inf", "-inf"])
def test_points_that_are_not_finite_name_the_prim(tmp_path: Path, number: str) -> None:
    file = stage(tmp_path, triangle("Broken", points=f"(0, 0, 0), (1, 0, {number}), (0, 1, 0)"))
    with pytest.raises(Problem, match="/Broken"):
        load_scene(file)


@pytest.mark.parametrize("op", ["double3 xformOp:translate = (nan, 0, 0)", "float3 xformOp:scale = (inf, 1, 1)"])
def test_a_transform_that_is_not_finite_is_a_problem(tmp_path: Path, op: str) -> None:
    move = f'{op}\nuniform token[] xformOpOrder = ["{op.split()[1]}"]'
    with pytest.raises(Problem, match="not finite"):
        load_scene(stage(tmp_path, triangle(extra=move)))


def test_positions_are_in_metres_relative_to_the_centre_of_the_bounds(tmp_path: Path) -> None:
    move = 'double3 xformOp:translate = (100000000, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    scene = load_scene(stage(tmp_path, triangle(extra=move), 'metersPerUnit = 0.01\nupAxis = "Z"'))
    np.testing.assert_allclose(scene.origin, (1e6 + 0.005, 0.005, 0.0))
    # In float32 at a million metres the triangle would vanish: transforms are float64 until the origin is gone.
    np.testing.assert_allclose(scene.bounds, [[-0.005, -0.005, 0.0], [0.005, 0.005, 0.0]], atol=1e-9)
    assert scene.up == (0.0, 0.0, 1.0)
    assert scene.metres_per_unit == 0.01


def test_normals_turn_with_the_inverse_transpose_and_mirrors_keep_the_outside_outside(tmp_path: Path) -> None:
    slope = "(0, 0, 0), (1, 0, 1), (0, 1, 0)"
    scale = 'float3 xformOp:scale = (-2, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    scene = load_scene(stage(tmp_path, triangle(points=slope, extra=scale)))
    expected = np.array([0.5, 0.0, 1.0]) / np.hypot(0.5, 1.0)
    np.testing.assert_allclose(scene.normals, np.tile(expected, (3, 1)), atol=1e-6)
    a, b, c = world(scene)[0]
    assert np.cross(b - a, c - a) @ expected > 0


def test_invisible_prims_and_other_purposes_are_left_out_but_render_is_drawn(tmp_path: Path) -> None:
    body = (
        triangle("Plain")
        + triangle("Render", 'uniform token purpose = "render"')
        + triangle("Proxy", 'uniform token purpose = "proxy"')
        + triangle("Guide", 'uniform token purpose = "guide"')
        + f'def Xform "Hidden" {{ token visibility = "invisible"\n{triangle("Child")} }}\n'
    )
    assert load_scene(stage(tmp_path, body)).triangles == 2


def test_time_samples_are_read_at_the_start_of_the_range_or_at_the_time_asked_for(
    tmp_path: Path,
) -> None:
    samples = "point3f[] points.timeSamples = { 5: [(0,0,0),(1,0,0),(0,1,0)], 9: [(0,0,0),(3,0,0),(0,3,0)] }"
    body = triangle().replace("point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]", samples)
    file = stage(tmp_path, body, "metersPerUnit = 1\nstartTimeCode = 5\nendTimeCode = 9")
    assert load_scene(file).bounds[1, 0] == 0.5
    assert load_scene(file, LoadOptions(time=9.0)).bounds[1, 0] == 1.5
    assert load_scene(file, LoadOptions(time=7.0)).bounds[1, 0] == 1.0


VARIANTS = """
def Xform "A" ( variants = { string size = "one" }; prepend variantSets = "size" )
{
    variantSet "size" = {
        "one" { %s }
        "two" { %s %s }
    }
}
"""


def test_variants_are_chosen_by_name_and_unknown_ones_are_problems(tmp_path: Path) -> None:
    file = stage(tmp_path, VARIANTS % (triangle("P"), triangle("P"), triangle("Q", points="(0,0,1),(1,0,1),(0,1,1)")))
    assert load_scene(file).triangles == 1
    assert load_scene(file, LoadOptions(variants=("size=two",))).triangles == 2
    assert load_scene(file, LoadOptions(variants=("/A:size=two",))).triangles == 2
    with pytest.raises(Problem, match=r"no variant 'size=three'.*one\|two") as caught:
        load_scene(file, LoadOptions(variants=("size=three",)))
    assert caught.value.code == ExitCode.NOT_FOUND
    assert load_scene(file).triangles == 1, "a selection must not stay in the layer"


INSTANCER = """
def PointInstancer "Many"
{
    rel prototypes = [</Many/Kinds/A>, </Many/Kinds/B>]
    int[] protoIndices = [0, 1, 0, 1]
    point3f[] positions = [(0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)]
    %s
    def Scope "Kinds"
    {
        def Xform "A" { double3 xformOp:translate = (0, 0, 5)
            uniform token[] xformOpOrder = ["xformOp:translate"]
            %s }
        over "B" { %s }
    }
}
"""


def test_point_instances_follow_prototypes_with_their_transforms_even_overs(tmp_path: Path) -> None:
    file = stage(tmp_path, INSTANCER % ("", triangle("T"), triangle("T")))
    corners = world(load_scene(file))[:, :, 0].min(axis=1)
    heights = world(load_scene(file))[:, 0, 2]
    np.testing.assert_allclose(sorted(corners), [0, 10, 20, 30], atol=1e-5)
    np.testing.assert_allclose(heights[np.argsort(corners)], [5, 0, 5, 0], atol=1e-5)


def test_point_instances_have_scales_orientations_and_can_be_hidden_by_id(tmp_path: Path) -> None:
    extra = """
    float3[] scales = [(1,1,1), (2,2,2), (1,1,1), (1,1,1)]
    quath[] orientations = [(1,0,0,0), (0,0,0,1), (1,0,0,0), (1,0,0,0)]
    int64[] ids = [7, 8, 9, 10]
    int64[] invisibleIds = [7, 9, 10]
    """
    scene = load_scene(stage(tmp_path, INSTANCER % (extra, triangle("T"), triangle("T"))))
    # Instance 8: twice the size, half a turn about z, at x = 10.
    expected = np.array([[10, 0, 0], [8, 0, 0], [10, -2, 0]])
    np.testing.assert_allclose(world(scene)[0], expected, atol=1e-5)


def test_nested_point_instancers_multiply(tmp_path: Path) -> None:
    inner = (
        INSTANCER.replace("Many", "Inner")
        .replace("</Inner", "</Many/Kinds/A/Inner")
        .replace("(10, 0, 0), (20, 0, 0), (30, 0, 0)", "(0, 10, 0), (0, 20, 0), (0, 30, 0)")
    ) % ("", triangle("T"), triangle("T"))
    scene = load_scene(stage(tmp_path, INSTANCER % ("", inner, triangle("T"))))
    assert scene.triangles == 2 * 4 + 2


def test_native_instances_share_geometry_but_not_inherited_colours(tmp_path: Path) -> None:
    colour = "color3f[] primvars:displayColor = [(%s)]"
    prototype = f'class "P" {{ {triangle("T")} }}\n'
    body = prototype + "".join(
        f'def Xform "I{i}" ( references = </P>; instanceable = true ) {{ {colour % c}\n'
        f'double3 xformOp:translate = ({i}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"] }}\n'
        for i, c in enumerate(("1, 0, 0", "0, 1, 0", "1, 0, 0"))
    )
    scene = load_scene(stage(tmp_path, body))
    order = np.argsort(world(scene)[:, 0, 0])
    colours = scene.colours[scene.indices.reshape(-1, 3)][order, 0]
    np.testing.assert_array_equal(colours[:, :3], [[255, 0, 0], [0, 255, 0], [255, 0, 0]])
    np.testing.assert_allclose(world(scene)[order, 0, 0], [0, 1, 2], atol=1e-6)


def test_unsupported_and_missing_things_are_warnings_with_the_prims_path(tmp_path: Path) -> None:
    body = triangle() + (
        'def NurbsCurves "Hair" { int[] curveVertexCounts = [2]\npoint3f[] points = [(0,0,0),(1,0,0)] }\n'
        'def Xform "Gone" ( references = @./absent.usda@ ) {}\n'
    )
    warnings = "\n".join(load_scene(stage(tmp_path, body)).warnings)
    assert "NurbsCurves prims are not drawn: /Hair" in warnings
    assert "absent.usda" in warnings
    assert "/Gone" in warnings
    assert "0x" not in warnings, "addresses would make two runs differ"


@pytest.mark.parametrize(
    ("schema", "extra", "size", "area"),
    [
        ("Cube", "double size = 2", (2, 2, 2), 24.0),
        ("Sphere", "double radius = 1", (2, 2, 2), 4 * np.pi),
        ("Cylinder", 'double radius = 1\ndouble height = 3\ntoken axis = "X"', (3, 2, 2), 8 * np.pi),
        ("Cone", 'double radius = 1\ndouble height = 2\ntoken axis = "Y"', (2, 2, 2), np.pi * (1 + np.sqrt(5))),
        ("Capsule", "double radius = 1\ndouble height = 2", (2, 2, 4), 8 * np.pi),
        ("Plane", 'double width = 2\ndouble length = 4\ntoken axis = "Y"', (2, 0, 4), 8.0),
    ],
)
def test_gprims_have_the_right_size_area_and_outward_normals(
    tmp_path: Path, schema: str, extra: str, size: tuple[float, float, float], area: float
) -> None:
    scene = load_scene(stage(tmp_path, f'def {schema} "G" {{ {extra} }}'))
    np.testing.assert_allclose(scene.bounds[1] - scene.bounds[0], size, atol=1e-5)
    a, b, c = np.moveaxis(scene.positions[scene.indices.reshape(-1, 3)].astype(np.float64), 1, 0)
    vectors = np.cross(b - a, c - a)
    assert 0.5 * np.linalg.norm(vectors, axis=1).sum() == pytest.approx(area, rel=0.02)
    normals = scene.normals[scene.indices.reshape(-1, 3)]
    assert np.all(np.einsum("tki,ti->tk", normals, vectors) > 0)
    if schema != "Plane":
        assert np.all(np.einsum("ti,ti->t", a, vectors) > 0), "solids wind counter-clockwise from outside"


def test_cameras_become_views_in_metres(tmp_path: Path) -> None:
    camera = """
    def Camera "Persp" {
        float focalLength = 50
        float verticalAperture = 40
        float2 clippingRange = (1, 500)
        double3 xformOp:translate = (0, 0, 10)
        uniform token[] xformOpOrder = ["xformOp:translate"] }
    def Camera "Ortho" { token projection = "orthographic"
        float verticalAperture = 30 }
    """
    scene = load_scene(stage(tmp_path, triangle() + camera, "metersPerUnit = 0.1"))
    persp, ortho = scene.cameras
    np.testing.assert_allclose(np.array(persp.eye) + scene.origin, (0, 0, 1.0))
    assert persp.fov == pytest.approx(2 * np.degrees(np.arctan(0.4)))
    assert (persp.near, persp.far) == (pytest.approx(0.1), pytest.approx(50.0))
    assert ortho.ortho_height == pytest.approx(0.3)
    looking = np.array(persp.target) - np.array(persp.eye)
    np.testing.assert_allclose(looking / np.linalg.norm(looking), (0, 0, -1))


def test_the_digest_follows_contents_not_places(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    for folder in (one, two):
        folder.mkdir()
        stage(folder, triangle(), name="part.usda")
        stage(folder, 'def Xform "A" ( references = @./part.usda@</Tri> ) {}')
    assert scene_digest(one / "scene.usda") == scene_digest(two / "scene.usda")
    stage(two, triangle(points="(0, 0, 0), (2, 0, 0), (0, 1, 0)"), name="part.usda")
    assert scene_digest(one / "scene.usda") != scene_digest(two / "scene.usda")
    (one / "part.usda").unlink()
    assert scene_digest(one / "scene.usda") != scene_digest(two / "scene.usda")


def test_a_usdz_package_loads_like_its_layer(tmp_path: Path) -> None:
    file = stage(tmp_path, triangle())
    package = tmp_path / "packed.usdz"
    assert UsdUtils.CreateNewUsdzPackage(str(file), str(package))
    np.testing.assert_array_equal(load_scene(package).positions, load_scene(file).positions)
    assert len(scene_digest(package)) == 64


def test_a_stage_without_default_prim_up_axis_and_units_loads_with_usds_defaults(tmp_path: Path) -> None:
    scene = load_scene(stage(tmp_path, triangle(), header=""))
    assert scene.metres_per_unit == UsdGeom.LinearUnits.centimeters
    assert scene.up == (0.0, 1.0, 0.0)


def test_alpha_outside_its_range_is_a_problem() -> None:
    for alpha in (0.0, -0.1, 1.5, float("nan")):
        with pytest.raises(Problem, match="alpha"):
            LoadOptions(alpha=alpha)


def test_loading_leaves_the_layer_as_it_was(tmp_path: Path) -> None:
    file = stage(tmp_path, triangle())
    before = file.read_bytes()
    load_scene(file)
    assert file.read_bytes() == before
    assert not Usd.Stage.Open(str(file)).GetRootLayer().dirty


def test_a_damaged_file_whose_error_is_no_text_is_still_a_problem(tmp_path: Path) -> None:
    file = tmp_path / "bytes.usda"
    file.write_bytes(b'#usda 1.0\ndef Mesh "a\xf3\xff\xfe" { \xf3\xff }\n')
    with pytest.raises(Problem, match="cannot be read as USD"):
        load_scene(file)
