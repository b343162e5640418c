"""What a stage can hold besides plain meshes: time, visibility, purposes, variants, instancing, polygons, cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom
from pydantic import ValidationError
from support.stages import stage, triangle, world

from renderer.scene import LoadOptions, load_scene
from renderer.usd.native import Likeness
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.scene import SceneArrays
from schemas.view import View


def lefts(file: Path, options: LoadOptions | None = None) -> list[float]:
    """The smallest x of each triangle, sorted."""
    return sorted(world(load_scene(file, options or LoadOptions()))[:, :, 0].min(axis=1).round(4).tolist())


def placed(x: float, extra: str = "", kind: str = "Xform", name: str = "") -> str:
    name = name or f"X{int(x)}"
    move = f'double3 xformOp:translate = ({x}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"]'
    return f'def {kind} "{name}"\n{{\n{move}\n{extra}\n}}\n'


SAMPLED = "point3f[] points.timeSamples = { %s: [(0, 0, 0), (%s, 0, 0), (0, 1, 0)] }"


@pytest.mark.parametrize(
    "header", ["startTimeCode = 101\nendTimeCode = 101", "startTimeCode = 101", "endTimeCode = 9", ""]
)
def test_points_authored_at_one_frame_only_are_found(tmp_path: Path, header: str) -> None:
    body = triangle().replace("point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]", SAMPLED % (101, 7))
    scene = load_scene(stage(tmp_path, body, f"metersPerUnit = 1\n{header}"))
    assert scene.bounds[1, 0] == 3.5


def test_an_empty_default_does_not_hide_samples(tmp_path: Path) -> None:
    both = "point3f[] points = []\n" + SAMPLED % (24, 5)
    body = triangle().replace("point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]", both)
    assert load_scene(stage(tmp_path, body)).bounds[1, 0] == 2.5


def test_transforms_and_visibility_are_those_of_the_time(tmp_path: Path) -> None:
    moving = "double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 10: (20, 0, 0) }\n"
    moving += 'uniform token[] xformOpOrder = ["xformOp:translate"]'
    blinking = 'token visibility.timeSamples = { 0: "inherited", 5: "invisible" }'
    body = triangle("Moves", moving) + f'def Xform "Group" {{ {blinking}\n{placed(50, triangle())} }}\n'
    file = stage(tmp_path, body, "metersPerUnit = 1\nstartTimeCode = 0\nendTimeCode = 10")
    assert lefts(file) == [0, 50]
    assert lefts(file, LoadOptions(time=4.0)) == [8, 50]
    assert lefts(file, LoadOptions(time=5.0)) == [10]


def test_a_prim_that_resets_its_transforms_stands_in_the_world(tmp_path: Path) -> None:
    reset = "double3 xformOp:translate = (3, 0, 0)\n"
    reset += 'uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]'
    assert lefts(stage(tmp_path, placed(100, triangle("R", reset) + triangle("T")))) == [3, 100]


def test_purposes_are_inherited_and_visible_below_invisible_is_still_invisible(tmp_path: Path) -> None:
    proxy = 'uniform token purpose = "proxy"\n'
    render = 'uniform token purpose = "render"\nrel proxyPrim = </Model/Stand>\n'
    body = (
        'def Xform "Model" {\n'
        + f'def Xform "Stand" {{ {proxy}{triangle("T")} }}\n'
        + f'def Xform "Real" {{ {render}{placed(10, triangle("T"))} }}\n }}\n'
        + f'def Xform "Guides" {{ uniform token purpose = "guide"\n{placed(20, triangle("T"))} }}\n'
        + 'def Xform "Dark" { token visibility = "invisible"\n'
        + f"{placed(30, 'token visibility = ' + chr(34) + 'inherited' + chr(34) + chr(10) + triangle('T'))} }}\n"
    )
    assert lefts(stage(tmp_path, body)) == [10]


OUTER = """
def Xform "A" ( variants = { string size = "small" }; prepend variantSets = "size" )
{
    variantSet "size" = {
        "small" { %s }
        "large" {
            def Xform "B" ( variants = { string tint = "one" }; prepend variantSets = "tint" )
            {
                variantSet "tint" = {
                    "one" { %s }
                    "two" { %s }
                }
            }
        }
    }
}
"""


@pytest.mark.parametrize("selections", [("size=large", "tint=two"), ("tint=two", "size=large")])
def test_variants_that_appear_with_another_selection_can_be_chosen_in_any_order(
    tmp_path: Path, selections: tuple[str, ...]
) -> None:
    file = stage(tmp_path, OUTER % tuple(placed(x, triangle()) for x in (0, 10, 20)))
    assert lefts(file) == [0]
    assert lefts(file, LoadOptions(variants=("size=large",))) == [10]
    assert lefts(file, LoadOptions(variants=selections)) == [20]
    assert lefts(file, LoadOptions(variants=("/A/B:tint=two", "/A:size=large"))) == [20]
    with pytest.raises(Problem, match=r"no variant 'tint=two'.*size=large\|small") as caught:
        load_scene(file, LoadOptions(variants=("tint=two",)))
    assert caught.value.code == ExitCode.NOT_FOUND


def test_the_last_of_several_selections_of_one_set_counts(tmp_path: Path) -> None:
    file = stage(tmp_path, OUTER % tuple(placed(x, triangle()) for x in (0, 10, 20)))
    assert lefts(file, LoadOptions(variants=("size=large", "size=small"))) == [0]
    with pytest.raises(Problem, match="not a variant selection"):
        load_scene(file, LoadOptions(variants=("large",)))


MANY = """
def PointInstancer "Many"
{
    rel prototypes = [</Many/P>, </Q>]
    int[] protoIndices = %s
    point3f[] positions = [(0, 0, 0), (10, 0, 0), (20, 0, 0), (30, 0, 0)]
    %s
    def Xform "P" { %s }
}
def Xform "Hidden" { token visibility = "invisible"
    def Xform "Deep" { } }
class Xform "Q" { double3 xformOp:translate = (0, 0, 2)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    %s }
"""


def many(folder: Path, extra: str = "", indices: str = "[0, 1, 0, 1]") -> Path:
    return stage(folder, MANY % (indices, extra, triangle(), triangle()))


def test_instances_can_be_deactivated_by_metadata_and_hidden_at_a_time(tmp_path: Path) -> None:
    assert lefts(many(tmp_path)) == [0, 10, 20, 30]
    hidden = "int64[] invisibleIds.timeSamples = { 0: [], 5: [1, 2] }"
    assert lefts(many(tmp_path, hidden), LoadOptions(time=5.0)) == [0, 30]
    inactive = many(tmp_path).read_text().replace('"Many"', '"Many" (\ninactiveIds = [0]\n)', 1)
    (tmp_path / "inactive.usda").write_text(inactive)
    assert lefts(tmp_path / "inactive.usda") == [10, 20, 30]


@pytest.mark.parametrize("kind", ["quath[] orientations", "quatf[] orientationsf"])
def test_orientations_have_half_or_full_precision(tmp_path: Path, kind: str) -> None:
    turned = f"{kind} = [(0,0,0,1), (1,0,0,0), (1,0,0,0), (1,0,0,0)]"
    assert lefts(many(tmp_path, turned)) == [-1, 10, 20, 30]


def test_prototypes_that_are_classes_elsewhere_or_missing(tmp_path: Path) -> None:
    scene = load_scene(many(tmp_path))
    assert sorted(world(scene)[:, 0, 2].tolist()) == [0, 0, 2, 2]
    (tmp_path / "gone.usda").write_text(many(tmp_path).read_text().replace("</Q>]", "</Gone>]"))
    gone = load_scene(tmp_path / "gone.usda")
    assert gone.triangles == 2
    assert any("prototype is missing: /Gone" in line for line in gone.warnings)


def test_instances_of_no_prototype_are_left_out_with_a_warning(tmp_path: Path) -> None:
    file = many(tmp_path, indices="[0, 7, -1, 1]")
    assert lefts(file) == [0, 30]
    assert any("prototypes that do not exist" in line and "/Many" in line for line in load_scene(file).warnings)


def test_an_instancer_whose_arrays_differ_is_left_out_with_a_warning(tmp_path: Path) -> None:
    file = many(tmp_path, indices="[0, 1, 0]")
    both = tmp_path / "both.usda"
    both.write_text(file.read_text() + triangle())
    scene = load_scene(both)
    assert scene.triangles == 1
    assert any("/Many" in line and "left out" in line for line in scene.warnings)


def test_invisible_prototypes_are_drawn_where_their_parents_only_are_invisible(tmp_path: Path) -> None:
    body = f"""
def PointInstancer "Many"
{{
    rel prototypes = [</Store/P>]
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 0), (10, 0, 0)]
}}
def Scope "Store" {{ token visibility = "invisible"
    {placed(100, triangle(), name="P")} }}
"""
    assert lefts(stage(tmp_path, body)) == [100, 110]


def test_native_instances_inside_point_instancers_and_the_other_way_round(tmp_path: Path) -> None:
    body = f"""
class "Leaf" {{ {triangle()} }}
class Xform "Branch"
{{
    def PointInstancer "Leaves"
    {{
        rel prototypes = [</Branch/Leaves/P>]
        int[] protoIndices = [0, 0]
        point3f[] positions = [(0, 0, 0), (10, 0, 0)]
        def Xform "P" ( references = </Leaf>; instanceable = true ) {{ }}
    }}
}}
def Xform "One" ( references = </Branch>; instanceable = true ) {{ }}
def Xform "Two" ( references = </Branch>; instanceable = true ) {{ double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
"""
    assert lefts(stage(tmp_path, body)) == [0, 10, 100, 110]


def test_instances_do_not_share_what_they_inherit(tmp_path: Path) -> None:
    look = """
def Material "Glass" { token outputs:surface.connect = </Glass/S.outputs:surface>
    def Shader "S" { uniform token info:id = "UsdPreviewSurface"
        float inputs:opacity.connect = </Glass/R.outputs:result>
        token outputs:surface }
    def Shader "R" { uniform token info:id = "UsdPrimvarReader_float"
        string inputs:varname = "fade"
        float outputs:result } }
"""
    bound = (
        triangle()
        .replace('def Mesh "Tri"', 'def Mesh "Tri" ( prepend apiSchemas = ["MaterialBindingAPI"]\n)')
        .replace("{", "{\nrel material:binding = </Glass>", 1)
    )
    body = look + f'class "P" {{ {bound} }}\n'
    for i, fade in enumerate((0.2, 0.8, 0.2)):
        body += f'def Xform "I{i}" ( references = </P>; instanceable = true ) {{ float primvars:fade = {fade}\n'
        body += f'double3 xformOp:translate = ({i}, 0, 0)\nuniform token[] xformOpOrder = ["xformOp:translate"] }}\n'
    scene = load_scene(stage(tmp_path, body))
    order = np.argsort(world(scene)[:, 0, 0])
    np.testing.assert_array_equal(scene.colours[scene.indices.reshape(-1, 3)][order, 0, 3], [51, 204, 51])


CONCAVE = {
    # The fan from the first corner would reach outside of each.
    "dart": [(2, 2), (0, 0.5), (-2, 2), (0, 0)],
    "ell": [(1, 1), (0, 1), (0, 0), (3, 0), (3, 3), (2, 3), (2, 1)],
    "star": [((2 - i % 2) * np.cos(i * np.pi / 5), (2 - i % 2) * np.sin(i * np.pi / 5)) for i in range(10)],
}


@pytest.mark.parametrize("orientation", ["rightHanded", "leftHanded"])
@pytest.mark.parametrize("name", CONCAVE)
def test_concave_polygons_are_covered_once(tmp_path: Path, name: str, orientation: str) -> None:
    corners = np.array(CONCAVE[name])
    points = ", ".join(f"({x}, {y}, {2 * x})" for x, y in corners)
    body = f"""
def Mesh "Face"
{{
    int[] faceVertexCounts = [{len(corners)}]
    int[] faceVertexIndices = {list(range(len(corners)))}
    point3f[] points = [{points}]
    uniform token subdivisionScheme = "none"
    uniform token orientation = "{orientation}"
}}
"""
    scene = load_scene(stage(tmp_path, body))
    a, b, c = np.moveaxis(world(scene), 1, 0)
    areas = 0.5 * np.cross(b - a, c - a)[:, 2]
    x, y = corners.T
    polygon = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    sign = 1 if orientation == "rightHanded" else -1
    assert len(areas) == len(corners) - 2
    assert np.all(areas * polygon * sign > 0)
    assert areas.sum() == pytest.approx(polygon * sign)


def test_mixed_handedness_keeps_outsides_outside(tmp_path: Path) -> None:
    body = triangle("R") + placed(5, triangle("L", 'uniform token orientation = "leftHanded"'))
    scene = load_scene(stage(tmp_path, body))
    a, b, c = np.moveaxis(world(scene), 1, 0)
    facing = np.cross(b - a, c - a)[:, 2] > 0
    np.testing.assert_array_equal(facing[np.argsort(a[:, 0])], [True, False])
    assert scene.normals[scene.indices.reshape(-1, 3)][~facing][..., 2].max() < 0


def test_draw_modes_are_named_and_the_model_is_drawn(tmp_path: Path) -> None:
    meta = '( kind = "component"; prepend apiSchemas = ["GeomModelAPI"]\n)'
    body = f'def Xform "Card" {meta}\n{{\nuniform token model:drawMode = "cards"\n{triangle()}}}\n'
    scene = load_scene(stage(tmp_path, body))
    assert scene.triangles == 1
    assert any("drawMode" in line and "/Card" in line for line in scene.warnings)


@pytest.mark.parametrize("schema", ["NurbsCurves", "NurbsPatch", "HermiteCurves", "TetMesh", "Volume"])
def test_kinds_of_geometry_that_are_not_drawn_are_named(tmp_path: Path, schema: str) -> None:
    scene = load_scene(stage(tmp_path, triangle() + f'def {schema} "Odd" {{ }}\n'))
    assert any(f"{schema} prims are not drawn: /Odd" in line for line in scene.warnings)


@pytest.mark.parametrize("up", ["Y", "Z"])
@pytest.mark.parametrize("metres", [0.001, 1.0, 1000.0])
def test_any_unit_and_up_axis(tmp_path: Path, up: str, metres: float) -> None:
    scene = load_scene(stage(tmp_path, triangle(), f'metersPerUnit = {metres}\nupAxis = "{up}"'))
    np.testing.assert_allclose(scene.bounds[1], [0.5 * metres, 0.5 * metres, 0.0], rtol=1e-6)
    assert scene.up == ((0.0, 1.0, 0.0) if up == "Y" else (0.0, 0.0, 1.0))


SHIFTED = """
def Camera "Shifted" {
    token projection = "%s"
    float focalLength = 50
    float horizontalAperture = 30
    float verticalAperture = 20
    float horizontalApertureOffset = 6
    float verticalApertureOffset = -4
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
"""


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_aperture_offsets_shift_the_picture_as_gfcamera_does(tmp_path: Path, projection: str) -> None:
    file = stage(tmp_path, triangle() + SHIFTED % projection)
    (view,) = load_scene(file).cameras
    assert view.shift == (pytest.approx(0.3), pytest.approx(-0.2))
    opened = Usd.Stage.Open(str(file))
    camera = UsdGeom.Camera(opened.GetPrimAtPath("/Shifted")).GetCamera(Usd.TimeCode.Default())
    expected = np.array(camera.frustum.ComputeProjectionMatrix()).T
    window = view.projection(1.5, camera.clippingRange.min, camera.clippingRange.max)
    np.testing.assert_allclose(window, expected, atol=1e-5)
    assert isinstance(camera, Gf.Camera)


def test_a_camera_s_name_fits_into_an_address_or_is_a_problem(tmp_path: Path) -> None:
    most = "c" * LIMITS.view_name
    camera = 'def Xform "%s" { def Camera "%s" { } }\n'
    (view,) = load_scene(stage(tmp_path, triangle() + camera % ("A", most))).cameras
    assert view.name == most
    for cameras in (camera % ("A", f"{most}c"), camera % ("A", most) + camera % ("B", most)):  # the second is numbered
        with pytest.raises(Problem, match=f"at most {LIMITS.view_name}") as refused:
            load_scene(stage(tmp_path, triangle() + cameras))
        assert refused.value.code == ExitCode.LIMIT
    with pytest.raises(ValidationError):
        View(name=f"{most}c", eye=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))


def test_a_view_without_a_shift_reads_and_looks_as_before() -> None:
    old = '{"name": "v", "eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0]}'
    view = View.model_validate_json(old)
    assert view.shift == (0.0, 0.0)
    assert View.model_validate_json(view.model_dump_json()) == view
    np.testing.assert_array_equal(view.projection(1.5, 1.0, 2.0)[:2, 2:], 0.0)
    with pytest.raises(ValueError, match="finite"):
        View.model_validate({**view.model_dump(), "shift": (float("nan"), 0.0)})


MIXED = f"""
class "Leaf" ( prepend apiSchemas = ["MaterialBindingAPI"] )
{{
    {triangle()}
    def Xform "Own" {{ color3f[] primvars:displayColor = [(0, 0, 1)]
        {placed(3, triangle())} }}
}}
class Xform "Odd" {{ {triangle()}
    def Xform "Away" {{ double3 xformOp:translate = (-50, 0, 0)
        uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:translate"]
        {triangle()} }} }}
def Xform "Red" {{ color3f[] primvars:displayColor = [(1, 0, 0)]
    def Xform "A" ( references = </Leaf>; instanceable = true ) {{ }}
    def Xform "B" ( references = </Leaf>; instanceable = true ) {{ float3 xformOp:scale = (-2, 1, 1)
        uniform token[] xformOpOrder = ["xformOp:scale"] }} }}
def Xform "Faded" {{ float[] primvars:displayOpacity = [0.5]
    def Xform "C" ( references = </Leaf>; instanceable = true ) {{ color3f[] primvars:displayColor = [(0, 1, 0)] }}
    def Xform "D" ( references = </Leaf>; instanceable = true ) {{ double3 xformOp:translate = (9, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"] }}
    def Xform "E" ( references = </Leaf>; instanceable = true ) {{ uniform token purpose = "guide" }}
    def Xform "F" ( references = </Leaf>; instanceable = true ) {{ token visibility = "invisible" }} }}
def Xform "G" ( references = </Odd>; instanceable = true ) {{ }}
def Xform "H" ( references = </Odd>; instanceable = true ) {{ double3 xformOp:translate = (0, 0, 7)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
def Mesh "I" ( references = </Leaf/Tri>; instanceable = true ) {{ double3 xformOp:translate = (0, 0, 8)
    uniform token[] xformOpOrder = ["xformOp:translate"] }}
"""


def rows(scene: SceneArrays) -> np.ndarray:
    """Each triangle with its normals and colours as one row, sorted."""
    corners = scene.indices.reshape(-1, 3)
    columns = (world(scene), scene.normals[corners], scene.colours[corners])
    table = np.concatenate([c.reshape(len(corners), -1) for c in columns], axis=1).round(4) + 0.0
    return table[np.lexsort(table.T)]


def test_instances_that_are_walked_once_look_as_if_each_was_walked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = stage(tmp_path, MIXED)
    once = load_scene(file)
    monkeypatch.setattr(Likeness, "key", lambda self, root: None)
    np.testing.assert_array_equal(rows(once), rows(load_scene(file)))


def test_instances_that_look_the_same_are_walked_once(tmp_path: Path) -> None:
    opened = Usd.Stage.Open(str(stage(tmp_path, MIXED)))
    alike = Likeness()
    keys = {name: alike.key(opened.GetPrimAtPath(name)) for name in ("/Red/A", "/Red/B", "/Faded/C", "/Faded/D")}
    assert keys["/Red/A"] == keys["/Red/B"] is not None
    assert len(set(keys.values())) == 3
    assert alike.key(opened.GetPrimAtPath("/G")) is None, "a part of it stays where it is"
    assert alike.key(opened.GetPrimAtPath("/I")) is None, "it is drawn itself"


def test_collections_bind_instances_one_by_one(tmp_path: Path) -> None:
    looks = "".join(
        f'def Material "{name}" {{ token outputs:surface.connect = </{name}/S.outputs:surface>\n'
        f'def Shader "S" {{ uniform token info:id = "UsdPreviewSurface"\n'
        f"color3f inputs:diffuseColor = ({colour})\ntoken outputs:surface }} }}\n"
        for name, colour in (("Red", "1, 0, 0"), ("Green", "0, 1, 0"))
    )
    body = f"""
class "P" {{ {triangle()} }}
def Xform "World" ( prepend apiSchemas = ["MaterialBindingAPI", "CollectionAPI:some"] )
{{
    uniform token collection:some:expansionRule = "expandPrims"
    rel collection:some:includes = [</World/A>]
    rel material:binding = </Red>
    rel material:binding:collection:some = [</World.collection:some>, </Green>]
    def Xform "A" ( references = </P>; instanceable = true ) {{ }}
    def Xform "B" ( references = </P>; instanceable = true ) {{ double3 xformOp:translate = (5, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"] }}
}}
"""
    scene = load_scene(stage(tmp_path, looks + body))
    order = np.argsort(world(scene)[:, 0, 0])
    colours = scene.colours[scene.indices.reshape(-1, 3)][order, 0, :3]
    np.testing.assert_array_equal(colours, [[0, 255, 0], [255, 0, 0]])
