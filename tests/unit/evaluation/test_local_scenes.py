"""Which camera is meant, and what is loaded again from frame to frame."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from pxr import Usd, UsdGeom, UsdRender

from evaluation.local_scenes import LocalScene, as_usd
from renderer.scene import LoadOptions
from schemas.problem import ExitCode, Problem


def stage_at(path: Path, *cameras: str) -> Usd.Stage:
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.Cube.Define(stage, "/World/Cube")
    for name in cameras:
        camera = UsdGeom.Camera.Define(stage, f"/World/{name}")
        camera.CreateHorizontalApertureAttr(30.0)
        camera.CreateVerticalApertureAttr(15.0)
    return stage


def opened(stage: Usd.Stage) -> LocalScene:
    stage.Save()
    path = Path(stage.GetRootLayer().realPath)
    scene = LocalScene(path, path, LoadOptions())
    scene.at(None)
    return scene


def test_without_a_camera_the_whole_scene_is_framed(tmp_path: Path) -> None:
    (chosen,) = opened(stage_at(tmp_path / "a.usda")).views(None, None)
    assert chosen.how == "no camera: the whole scene"
    assert chosen.aspect == pytest.approx(1.3704, abs=1e-4)


def test_the_first_camera_counts_but_for_the_primary_and_the_one_of_the_settings(tmp_path: Path) -> None:
    (first,) = opened(stage_at(tmp_path / "a.usda", "side", "top")).views(None, None)
    assert (first.view.name, first.aspect) == ("side", 2.0)
    stage = stage_at(tmp_path / "b.usda", "side", "main_cam", "top")
    (primary,) = opened(stage).views(None, None)
    assert (primary.view.name, primary.how) == ("main_cam", "primary camera")
    settings = UsdRender.Settings.Define(stage, "/Render/Settings")
    settings.CreateCameraRel().SetTargets(["/World/top"])
    stage.SetMetadata("renderSettingsPrimPath", "/Render/Settings")
    (chosen,) = opened(stage).views(None, None)
    assert (chosen.view.name, chosen.how) == ("top", "camera of the render settings")


def test_a_camera_is_named_by_name_or_path(tmp_path: Path) -> None:
    scene = opened(stage_at(tmp_path / "a.usda", "side", "top"))
    for name in ("top", "/World/top", "World/top"):
        assert scene.views(name, None)[0].view.name == "top"
    with pytest.raises(Problem, match="/World/side, /World/top") as caught:
        scene.views("bottom", None)
    assert caught.value.code == ExitCode.NOT_FOUND


def test_views_of_a_file_are_those_of_this_scene(tmp_path: Path) -> None:
    scene = opened(stage_at(tmp_path / "a.usda", "side"))
    view = {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40}
    listed = tmp_path / "views.json"
    listed.write_text(json.dumps({"scenes": [{"main": "a.usda", "views": [view, view]}, {"main": "b.usda"}]}))
    assert [chosen.view.name for chosen in scene.views(None, listed)] == ["view0", "view1"]
    with pytest.raises(Problem, match="Both"):
        scene.views("side", listed)
    listed.write_text(json.dumps({"scenes": []}))
    with pytest.raises(Problem, match="no views"):
        scene.views(None, listed)


def test_only_what_moves_is_loaded_again(tmp_path: Path) -> None:
    stage = stage_at(tmp_path / "a.usda", "side")
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/side"))
    lift = camera.AddTranslateOp()
    lift.Set((0, 0, 1), 1.0)
    lift.Set((0, 0, 2), 2.0)
    scene = opened(stage)
    first = scene.at(1.0)
    assert scene.cameras()[0].view.eye[2] == pytest.approx(0.01)
    assert scene.at(2.0) is first
    assert scene.cameras()[0].view.eye[2] == pytest.approx(0.02)

    moving = stage_at(tmp_path / "b.usda")
    slide = UsdGeom.Cube(moving.GetPrimAtPath("/World/Cube")).AddTranslateOp()
    slide.Set((0, 0, 0))
    slide.Set((1, 0, 0), 1.0)
    slide.Set((3, 0, 0), 2.0)
    scene = opened(moving)
    places = [scene.at(time).origin[0] for time in (1.0, 2.0, math.nan)]
    assert places == pytest.approx([0.01, 0.03, 0.0])
    assert scene.at(2.0) is scene.at(2.0)


def test_other_formats_are_converted_for_as_long_as_they_are_needed(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with as_usd(tmp_path / "a.obj") as usd:
        assert LocalScene(tmp_path / "a.obj", usd, LoadOptions()).at(None).triangles == 1
    assert not usd.exists()
    assert [path.name for path in tmp_path.iterdir()] == ["a.obj"]
    with as_usd(tmp_path / "b.usda") as usd:
        assert usd == tmp_path / "b.usda"
