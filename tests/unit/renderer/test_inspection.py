"""What a report says of small stages that have one of everything."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from renderer.inspection import inspect_scene
from renderer.scene import LoadOptions
from schemas.problem import ExitCode, Problem


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    made = Usd.Stage.CreateNew(str(tmp_path / "scene.usda"))
    made.SetDefaultPrim(UsdGeom.Xform.Define(made, "/World").GetPrim())
    UsdGeom.SetStageUpAxis(made, "Z")
    UsdGeom.SetStageMetersPerUnit(made, 0.5)
    return made


def path_of(stage: Usd.Stage) -> Path:
    stage.Save()
    return Path(stage.GetRootLayer().realPath)


def material(stage: Usd.Stage, name: str, **inputs: float) -> UsdShade.Material:
    made = UsdShade.Material.Define(stage, f"/World/Looks/{name}")
    shader = UsdShade.Shader.Define(stage, f"/World/Looks/{name}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    made.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    for key, value in inputs.items():
        shader.CreateInput(key, Sdf.ValueTypeNames.Float).Set(value)
    return made


def cube(stage: Usd.Stage, name: str, bound: UsdShade.Material | None = None) -> UsdGeom.Cube:
    made = UsdGeom.Cube.Define(stage, f"/World/{name}")
    if bound is not None:
        UsdShade.MaterialBindingAPI.Apply(made.GetPrim()).Bind(bound)
    return made


def test_prims_are_counted_by_type_with_why_some_are_not_drawn(stage: Usd.Stage) -> None:
    cube(stage, "seen")
    cube(stage, "hidden").MakeInvisible()
    cube(stage, "proxy").CreatePurposeAttr("proxy")
    cube(stage, "off").GetPrim().SetActive(False)
    UsdGeom.Cube(stage.CreateClassPrim("/Kind")).GetPrim().SetTypeName("Cube")
    UsdGeom.Points.Define(stage, "/World/none")
    report = inspect_scene(path_of(stage))
    cubes = report.prims["Cube"]
    assert (cubes.total, cubes.drawn) == (5, 1)
    assert cubes.reasons == {"invisible": 1, "purpose proxy": 1, "inactive": 1, "in a class": 1}
    assert report.prims["Points"].drawn == 0
    assert report.prims["Xform"].drawn is None
    assert report.purposes["proxy"] == 1
    assert report.triangles == {"opaque": 12}


def test_what_is_transparent_is_said_with_the_reason(stage: Usd.Stage) -> None:
    cube(stage, "a", material(stage, "glass", opacity=0.3))
    cube(stage, "b", material(stage, "solid"))
    material(stage, "spare", opacity=0.5)
    shown = cube(stage, "c")
    shown.CreateDisplayColorAttr([Gf.Vec3f(1, 0, 0)])
    shown.CreateDisplayOpacityAttr([0.5])
    report = inspect_scene(path_of(stage))
    facts = {path.rpartition("/")[2]: (fact.kind, fact.why, fact.triangles) for path, fact in report.materials.items()}
    assert facts == {
        "glass": ("transparent", "opacity 0.3", 12),
        "solid": ("opaque", "", 12),
        "spare": ("unused", "", 0),
        "unbound": ("transparent", "opacity from primvar displayOpacity", 12),
    }
    assert report.triangles == {"transparent": 24, "opaque": 12}
    every = inspect_scene(path_of(stage), LoadOptions(alpha=0.25))
    assert every.triangles == {"transparent": 36}
    assert "every surface has alpha 0.25" in every.materials["/World/Looks/solid"].why


def test_copies_count_and_their_materials_have_paths_that_a_user_knows(stage: Usd.Stage) -> None:
    inner = UsdGeom.Xform.Define(stage, "/Kept/Lamp").GetPrim()
    stage.GetPrimAtPath("/Kept").SetSpecifier(Sdf.SpecifierClass)
    UsdGeom.Cube.Define(stage, "/Kept/Lamp/Body")
    glass = UsdShade.Material.Define(stage, "/Kept/Lamp/Glass")
    shader = UsdShade.Shader.Define(stage, "/Kept/Lamp/Glass/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(0.4)
    glass.CreateSurfaceOutput().ConnectToSource(shader.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    UsdShade.MaterialBindingAPI.Apply(stage.GetPrimAtPath("/Kept/Lamp/Body")).Bind(glass)
    for number in range(3):
        copy = UsdGeom.Xform.Define(stage, f"/World/Copy{number}")
        copy.AddTranslateOp().Set((4.0 * number, 0.0, 0.0))
        copy.GetPrim().GetReferences().AddInternalReference(inner.GetPath())
        copy.GetPrim().SetInstanceable(True)
    report = inspect_scene(path_of(stage))
    assert (report.meshes, report.instances, report.triangles) == (1, 3, {"transparent": 36})
    (used,) = (path for path, fact in report.materials.items() if fact.kind == "transparent")
    assert used.startswith("/World/Copy")
    assert used.endswith("/Glass")
    # Half a metre a unit, the cubes are 2 units wide.
    np.testing.assert_allclose(report.bounds, [[-0.5, -0.5, -0.5], [4.5, 0.5, 0.5]])


def test_cameras_times_units_and_variants(stage: Usd.Stage) -> None:
    cube(stage, "a")
    stage.SetStartTimeCode(1)
    stage.SetEndTimeCode(48)
    camera = UsdGeom.Camera.Define(stage, "/World/Shot")
    camera.CreateFocalLengthAttr(10.0)
    camera.CreateVerticalApertureAttr(20.0)
    camera.CreateHorizontalApertureAttr(30.0)
    plan = UsdGeom.Camera.Define(stage, "/World/Plan")
    plan.CreateProjectionAttr("orthographic")
    plan.CreateVerticalApertureAttr(40.0)
    chosen = stage.GetDefaultPrim().GetVariantSets().AddVariantSet("finish")
    for choice in ("dull", "bright"):
        chosen.AddVariant(choice)
    chosen.SetVariantSelection("bright")
    report = inspect_scene(path_of(stage))
    assert (report.up_axis, report.metres_per_unit, report.time_codes) == ("Z", 0.5, (1.0, 48.0, 24.0))
    assert not report.animated
    shot, ortho = report.cameras
    assert (shot.path, shot.projection, shot.fov, shot.aspect) == ("/World/Shot", "perspective", 90.0, 1.5)
    # 40 tenths of half a metre.
    assert (ortho.projection, ortho.fov, ortho.height) == ("orthographic", None, 2.0)
    (variant,) = report.variants
    assert (variant.name, set(variant.choices), variant.selected) == ("finish", {"dull", "bright"}, "bright")
    assert inspect_scene(path_of(stage), LoadOptions(variants=("finish=dull",))).variants[0].selected == "dull"


def test_missing_files_and_warnings_are_named(stage: Usd.Stage) -> None:
    cube(stage, "a")
    stage.DefinePrim("/World/Gone").GetReferences().AddReference("./nowhere.usda")
    report = inspect_scene(path_of(stage))
    assert [Path(name).name for name in report.missing] == ["nowhere.usda"]
    assert any("nowhere.usda" in warning for warning in report.warnings)


def test_a_scene_with_nothing_to_draw_is_reported_all_the_same(stage: Usd.Stage) -> None:
    UsdGeom.Camera.Define(stage, "/World/Shot")
    report = inspect_scene(path_of(stage))
    assert report.problem is not None
    assert report.problem.code == ExitCode.USAGE
    assert [camera.path for camera in report.cameras] == ["/World/Shot"]
    assert report.bounds is None
    assert json.loads(json.dumps(report.json()))["problem"] == report.problem.title


def test_a_report_is_plain_json(stage: Usd.Stage) -> None:
    cube(stage, "a", material(stage, "glass", opacity=0.3))
    values = json.loads(json.dumps(inspect_scene(path_of(stage)).json(), allow_nan=False))
    assert values["triangles"] == {"transparent": 12}
    assert values["materials"]["/World/Looks/glass"]["kind"] == "transparent"
    assert values["prims"]["Cube"] == {"total": 1, "drawn": 1, "reasons": {}}


def test_what_is_no_stage_is_said_so(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text("no")
    with pytest.raises(Problem, match="cannot be read"):
        inspect_scene(tmp_path / "a.usda")
