"""What is written as USD passes the validators of OpenUSD, those that `usdchecker` runs."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh
from attacks import glbs, make
from pxr import Sdf, Usd, UsdGeom, UsdShade

from renderer.convert import stage_file
from renderer.convert_meshes import convert_meshes
from renderer.samples import SAMPLES, write_samples
from renderer.samples.deep import DEEP

validation = pytest.importorskip("pxr.UsdValidation", reason="this OpenUSD has no validation framework")

GLBS = glbs.good(make.png())


def faults(path: Path) -> list[str]:
    """What the validators say of a stage, errors and warnings."""
    validators = validation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) >= 20
    stage = Usd.Stage.Open(str(path))
    return [each.GetErrorAsString() for each in validation.ValidationContext(validators).Validate(stage)]


def test_samples_have_no_fault(tmp_path: Path) -> None:
    paths = write_samples(tmp_path, SAMPLES)
    assert len(paths) >= 8
    assert {path.name: faults(path) for path in paths} == {path.name: [] for path in paths}


def test_deep_samples_have_no_fault(tmp_path: Path) -> None:
    smallest = dict(list(DEEP.items())[:3])
    paths = write_samples(tmp_path, smallest)
    assert {path.name: faults(path) for path in paths} == {path.name: [] for path in paths}


@pytest.mark.parametrize("name", sorted(GLBS))
def test_a_converted_glb_has_no_fault(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(GLBS[name])
    assert faults(stage_file(tmp_path, name, tmp_path / "cache")) == []


@pytest.mark.parametrize(("kind", "suffix"), [("obj", ".usda"), ("ply", ".usdc"), ("stl", ".usd"), ("glb", ".usdz")])
def test_what_scene_convert_writes_has_no_fault__kind(tmp_path: Path, kind: str, suffix: str) -> None:
    source, target = tmp_path / f"a.{kind}", tmp_path / f"out{suffix}"
    if kind == "glb":
        source.write_bytes(GLBS["texture.glb"])
    else:
        trimesh.creation.box((1, 2, 3)).export(source)
    assert convert_meshes(source, target).triangles > 0
    assert faults(target) == []


def test_a_faulty_stage_is_found(tmp_path: Path) -> None:
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    mesh = UsdGeom.Mesh.Define(stage, "/mesh")
    material = UsdShade.Material.Define(stage, "/material")
    mesh.GetPrim().CreateRelationship("material:binding").SetTargets([Sdf.Path(material.GetPath())])
    stage.Save()
    found = " ".join(faults(tmp_path / "a.usda"))
    assert "MaterialBindingAPI" in found
    assert "defaultPrim" in found
