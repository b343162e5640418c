"""Storm run for real, where `make peers` installed it; contact sheets and tables anywhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade

from evaluation.storm.compare import Compared, compare, sheet, table
from evaluation.storm.engine import Engine

PYTHON = Path(__file__).resolve().parents[4] / ".venv-peers" / "bin" / "python"
LAYERS = 12


def layers(file: Path) -> Path:
    """Squares behind each other, the nearest first: Storm's last eight miss the nearest four."""
    stage = Usd.Stage.CreateNew(str(file))
    UsdGeom.SetStageUpAxis(stage, "Y")
    for i in range(LAYERS):
        mesh = UsdGeom.Mesh.Define(stage, f"/square{i:02}")
        mesh.CreatePointsAttr([(-1, -1, -0.1 * i), (1, -1, -0.1 * i), (1, 1, -0.1 * i), (-1, 1, -0.1 * i)])
        mesh.CreateFaceVertexCountsAttr([4])
        mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
        mesh.CreateDoubleSidedAttr(True)
        material = UsdShade.Material.Define(stage, f"/glass{i:02}")
        shader = UsdShade.Shader.Define(stage, f"/glass{i:02}/surface")
        shader.CreateIdAttr("UsdPreviewSurface")
        colour = [0.0, 0.0, 0.0]
        colour[i % 3] = 1.0
        shader.CreateInput("emissiveColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(*colour))
        shader.CreateInput("opacity", Sdf.ValueTypeNames.Float).Set(0.33)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.Save()
    return file


@pytest.mark.skipif(not PYTHON.is_file(), reason="Storm is not installed: make peers")
def test_storm_misses_what_was_drawn_first_and_a_tail_does_not(tmp_path: Path) -> None:
    file = layers(tmp_path / "layers.usda")
    (found,) = compare(Engine.of(PYTHON), [file], (96, 64), None, tmp_path)
    assert found.problem is None
    assert found.mse is not None
    assert found.mse_nearest is not None
    assert found.mse > 1e-3
    assert found.mse_nearest < found.mse / 10.0
    assert (tmp_path / "layers.png").is_file()


def test_a_sheet_has_pictures_above_and_differences_below() -> None:
    black, grey = np.zeros((2, 3, 3), np.uint8), np.full((2, 3, 3), 4, np.uint8)
    made = sheet([black, grey])
    assert made.shape == (4, 6, 3)
    assert (made[:2, 3:] == 4).all()
    assert (made[2:, :3] == 0).all()
    assert (made[2:, 3:] == 32).all()


def test_a_row_says_what_was_measured_or_why_not() -> None:
    rows = table(
        [
            Compared("a", None, 4, 4, "25.02", 1e-3, 1e-5, 0.5, 0.6, 99),
            Compared("b", 0.33, 4, 4, problem="It is too deep."),
        ]
    ).splitlines()
    assert rows[2] == "| a | authored | 100 | 1 | 100x | 0.50 | 0.60 |"
    assert rows[3] == "| b | 0.33 | It is too deep. | | | | |"
