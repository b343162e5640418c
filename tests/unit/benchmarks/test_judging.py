"""A stage without light, here and in Storm where `make peers` installed it."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from benchmarks.casting.cases import Case
from benchmarks.judging import ours
from benchmarks.judging.judge import KINDS, judge
from evaluation.storm.engine import Engine
from renderer.scene import LoadOptions, load_scene
from renderer.views import framing_view

PYTHON = Path(__file__).resolve().parents[3] / ".venv-peers" / "bin" / "python"
COLOUR = (0.8, 0.4, 0.2)
SIZE = 48, 32


def square(stage: Usd.Stage, name: str, depth: float, opacity: float) -> UsdGeom.Mesh:
    """A square that faces z, with a UsdPreviewSurface."""
    mesh = UsdGeom.Mesh.Define(stage, f"/{name}")
    mesh.CreatePointsAttr([(x, y, depth) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    mesh.CreateSubdivisionSchemeAttr("none")
    material = UsdShade.Material.Define(stage, f"/{name}_look")
    shader = UsdShade.Shader.Define(stage, f"/{name}_look/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*COLOUR))
    shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(opacity)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    return mesh


def test_without_light_a_pixel_has_the_colour_and_the_opacity_of_its_surfaces(
    ctx: moderngl.Context, tmp_path: Path
) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "two.usda"))
    for number, opacity in enumerate((0.4, 0.25)):
        square(stage, f"pane{number}", float(number), opacity)
    stage.Save()
    scene = load_scene(tmp_path / "two.usda", LoadOptions(glass="plain"))
    seen = ours.shown(ctx, ours.unlit(scene), framing_view(scene), SIZE)
    middle = seen.rgba[SIZE[1] // 2, SIZE[0] // 2]
    assert middle[3] == pytest.approx(1.0 - 0.6 * 0.75, abs=4e-3)
    assert middle[:3] == pytest.approx(middle[3] * np.array(COLOUR), abs=1e-2)
    assert not np.isfinite(seen.depth).any()
    solid = ours.shown(ctx, ours.solid(scene), framing_view(scene), SIZE)
    assert np.isfinite(solid.depth[SIZE[1] // 2, SIZE[0] // 2])
    assert (solid.rgba[..., 3] == np.isfinite(solid.depth)).all()


@pytest.mark.skipif(not PYTHON.is_file(), reason="Storm is not installed: make peers")
def test_storm_agrees_about_a_stage_and_differs_about_one_that_is_read_wrongly(
    ctx: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "scene.usda"))
    UsdGeom.SetStageUpAxis(stage, "Y")
    square(stage, "pane", 0.5, 0.4)
    UsdGeom.XformCommonAPI(square(stage, "wall", 0.0, 1.0)).SetTranslate((0.3, 0.0, -0.5))
    camera = UsdGeom.Camera.Define(stage, "/camera")
    UsdGeom.XformCommonAPI(camera).SetTranslate((0.1, 0.2, 6.0))
    stage.Save()
    case, engine = Case("scene", tmp_path / "scene.usda"), Engine.of(PYTHON)
    verdict = judge(ctx, engine, case, None)
    assert verdict.refused == ""
    assert {kind: verdict.counts[kind].unexplained for kind in KINDS} == dict.fromkeys(KINDS, 0)
    assert all(verdict.counts[kind].equal > 0 for kind in KINDS)
    monkeypatch.setattr(ours, "UNLIT", 0.5)
    assert judge(ctx, engine, case, tmp_path / "sheets").counts["colour"].unexplained > 0
    assert list((tmp_path / "sheets").glob("scene-scene-*-look.png"))
