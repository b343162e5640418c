"""Stages with values of wrong types, damaged transforms, cameras and skeletons: a warning names the prim."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.stages import stage, triangle

from renderer.inspection import inspect_scene
from renderer.scene import LoadOptions, load_scene
from schemas.problem import Problem
from schemas.scene import SceneArrays

MESH = """int[] faceVertexCounts = [3]
int[] faceVertexIndices = [0, 1, 2]
point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
"""
CURVE = """int[] curveVertexCounts = [2]
point3f[] points = [(0, 0, 0), (1, 0, 0)]
uniform token type = "linear"
"""
MANY = """rel prototypes = </Good>
int[] protoIndices = [0]
point3f[] positions = [(0, 0, 0)]
"""
BODIES = {"Mesh": MESH, "BasisCurves": CURVE, "PointInstancer": MANY}
WRONG = ('string {} = "x"', "float {} = 1.5", "float[] {} = [1.5, nan]", 'string[] {} = ["a"]', "int2[] {} = [(1, 2)]")


def loaded(folder: Path, prim: str, options: LoadOptions | None = None) -> SceneArrays:
    return load_scene(stage(folder, triangle("Good") + prim), options or LoadOptions())


def warned(scene: SceneArrays, *words: str) -> bool:
    return any(all(word in line for word in words) for line in scene.warnings)


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("Sphere", "radius"),
        ("Cone", "height"),
        ("Plane", "axis"),
        ("Cylinder", "axis"),
        ("Mesh", "faceVertexCounts"),
        ("Mesh", "faceVertexIndices"),
        ("Mesh", "normals"),
        ("Mesh", "creaseSharpnesses"),
        ("BasisCurves", "curveVertexCounts"),
        ("BasisCurves", "normals"),
        ("PointInstancer", "protoIndices"),
        ("Camera", "focalLength"),
        ("Camera", "verticalAperture"),
        ("Camera", "horizontalAperture"),
        ("Camera", "clippingRange"),
        ("Camera", "focusDistance"),
        ("Camera", "horizontalApertureOffset"),
    ],
)
def test_values_of_a_wrong_type_spoil_their_prim_only(tmp_path: Path, kind: str, name: str, wrong: str) -> None:
    lines = [line for line in BODIES.get(kind, "").splitlines() if f" {name} = " not in line]
    prim = "\n".join((f'def {kind} "Odd" {{', *lines, wrong.format(name), "}"))
    assert loaded(tmp_path, prim, LoadOptions(refine=1)).triangles >= 1


@pytest.mark.parametrize("number", ["nan", "inf", "1e200"])
def test_a_gprim_without_a_sensible_size_is_left_out_with_a_warning(tmp_path: Path, number: str) -> None:
    scene = loaded(tmp_path, f'def Capsule "Odd" {{ double radius = {number}\n}}')
    assert scene.triangles == 1
    assert warned(scene, "its radius", "/Odd")


@pytest.mark.parametrize(
    "ops",
    [
        'uniform token[] xformOpOrder = ["xformOp:nope"]',
        'string xformOp:translate = "x"\nuniform token[] xformOpOrder = ["xformOp:translate"]',
    ],
)
def test_what_stands_below_a_damaged_transform_is_drawn(tmp_path: Path, ops: str) -> None:
    move = 'double3 xformOp:translate = (5, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    below = triangle("Below", extra=move)
    instances = 'def Xform "Copy" ( references = </Odd>; instanceable = true ) { }\n'
    many = 'def PointInstancer "Many" {\nrel prototypes = </Odd>\nint[] protoIndices = [0]\n'
    many += "point3f[] positions = [(9, 0, 0)]\n}"
    scene = loaded(tmp_path, f'def Xform "Odd" {{ {ops}\n{below}\n}}\n{instances}{many}')
    assert scene.triangles == 4
    lefts = np.sort((scene.positions[:, 0] + scene.origin[0]).reshape(4, 3).min(axis=1))
    assert np.allclose(lefts, np.array([0.0, 5.0, 5.0, 14.0]) * scene.metres_per_unit)
    assert warned(scene, "transform", "/Odd")


def test_copies_that_are_nowhere_name_their_prim(tmp_path: Path) -> None:
    many = 'def PointInstancer "Many" {\nrel prototypes = </Good>\nint[] protoIndices = [0]\n'
    with pytest.raises(Problem, match="/Good"):
        loaded(tmp_path, f"{many}point3f[] positions = [(nan, 0, 0)]\n}}")


def camera(*lines: str, at: str = "(0, 0, 5)", order: str = '"xformOp:translate"') -> str:
    move = f"double3 xformOp:translate = {at}\nuniform token[] xformOpOrder = [{order}]"
    return "\n".join(('def Camera "Odd" {', *lines, move, "}"))


@pytest.mark.parametrize(
    "prim",
    [
        camera("float verticalAperture = 1e38"),
        camera("float focalLength = 1e-30"),
        camera("float focalLength = 1e38"),
        camera("float verticalAperture = 1e-40", 'token projection = "orthographic"'),
        camera(at="(1e200, 0, 0)"),
        camera("matrix4d xformOp:transform = ((1,0,0,0),(0,0,1,0),(0,0,1,0),(0,0,5,1))", order='"xformOp:transform"'),
    ],
)
def test_cameras_that_make_no_picture_are_left_out_with_a_warning(tmp_path: Path, prim: str) -> None:
    scene = loaded(tmp_path, prim)
    assert not scene.cameras
    assert warned(scene, "camera", "/Odd")


def test_a_near_focus_of_a_far_camera_does_not_take_its_direction_away(tmp_path: Path) -> None:
    (view,) = loaded(tmp_path, camera("float focusDistance = 5", at="(0, 0, 1e17)")).cameras
    assert np.allclose(view.world_to_view()[2, :3], (0, 0, 1))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("float2 clippingRange = (1, inf)", "clipping range"),
        ("float2 clippingRange = (9, 1)", "clipping range"),
        ("float4[] clippingPlanes = [(1, 0, 0, 0)]", "clipping planes"),
    ],
)
def test_clipping_that_is_not_done_is_named(tmp_path: Path, line: str, words: str) -> None:
    scene = loaded(tmp_path, camera(line))
    assert len(scene.cameras) == 1
    assert warned(scene, words, "/Odd")


def test_primvars_of_single_instances_are_named(tmp_path: Path) -> None:
    one = 'float[] primvars:displayOpacity = [0.5] (interpolation = "varying")'
    assert warned(loaded(tmp_path, f'def PointInstancer "Odd" {{\n{MANY}{one}\n}}'), "displayOpacity", "/Odd")
    all_of_them = "float[] primvars:displayOpacity = [0.5]"
    assert not warned(loaded(tmp_path, f'def PointInstancer "Odd" {{\n{MANY}{all_of_them}\n}}'), "displayOpacity")


def test_a_mirrored_camera_is_named(tmp_path: Path) -> None:
    scene = loaded(tmp_path, camera("float3 xformOp:scale = (-1, 1, 1)", order='"xformOp:scale"'))
    assert len(scene.cameras) == 1
    assert warned(scene, "mirrors", "/Odd")


def test_large_normals_are_normals(tmp_path: Path) -> None:
    normals = 'normal3f[] normals = [(0, 0, 1e38), (0, 0, 2), (0, 0, 1)] (interpolation = "vertex")'
    flat = 'uniform token subdivisionScheme = "none"'
    scene = load_scene(stage(tmp_path, f'def Mesh "Odd" {{\n{MESH}{normals}\n{flat}\n}}'))
    assert np.allclose(scene.normals, (0, 0, 1))


@pytest.mark.parametrize(
    "header",
    ["metersPerUnit = nan", "metersPerUnit = inf", "startTimeCode = nan", "startTimeCode = inf\nendTimeCode = 2"],
)
def test_a_report_of_numbers_that_are_none_is_json(tmp_path: Path, header: str) -> None:
    file = tmp_path / "odd.usda"
    file.write_text(f"#usda 1.0\n(\n{header}\n)\n{triangle('Good')}")
    report = inspect_scene(file)
    assert report.problem is None
    assert json.loads(json.dumps(report.json(), allow_nan=False))["time_codes"] is None


def test_an_endless_time_is_a_problem() -> None:
    with pytest.raises(Problem, match="time of inf"):
        LoadOptions(time=np.inf)


def test_diagnostics_of_the_library_take_one_line_without_addresses(tmp_path: Path) -> None:
    scene = loaded(tmp_path, 'def Xform "A" ( references = </B> ) { }\ndef Xform "B" ( references = </A> ) { }')
    assert warned(scene, "Cycle detected")
    assert not any("\n" in line or "0x" in line for line in scene.warnings)


def shaded(texture: str, diffuse: str = "</Look/Image.outputs:rgb>", coordinates: str = "") -> str:
    return f"""def Mesh "Odd" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
{MESH}rel material:binding = </Look>
}}
def Material "Look" {{
token outputs:surface.connect = </Look/Surface.outputs:surface>
def Shader "Surface" {{
uniform token info:id = "UsdPreviewSurface"
color3f inputs:diffuseColor.connect = {diffuse}
token outputs:surface
}}
def Shader "Image" {{
uniform token info:id = "UsdUVTexture"
asset inputs:file = @{texture}@
float2 inputs:st.connect = </Look/Reader.outputs:result>
float3 outputs:rgb
}}
def Shader "Reader" {{
uniform token info:id = "UsdPrimvarReader_float2"
string inputs:varname = "st"
{coordinates}
float2 outputs:result
}}
}}
"""


def test_an_empty_texture_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "empty.png").touch()
    assert warned(loaded(tmp_path, shaded("./empty.png")), "empty.png", "/Look/Image")


def test_a_connection_to_nothing_is_named(tmp_path: Path) -> None:
    scene = loaded(tmp_path, shaded("", diffuse="</Look/Gone.outputs:rgb>"))
    assert warned(scene, "diffuseColor", "/Look/Gone")


def test_a_fallback_of_texture_coordinates_of_a_wrong_type_is_none(tmp_path: Path) -> None:
    (tmp_path / "white.ppm").write_bytes(b"P6 1 1 255 \xff\xff\xff")
    scene = loaded(tmp_path, shaded("./white.ppm", coordinates="float inputs:fallback = 0"))
    assert len(scene.textures) == 1
