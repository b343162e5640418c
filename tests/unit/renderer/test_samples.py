"""The sample scenes: same bytes every time, small, transparent, of the promised kinds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom

from renderer.samples import SAMPLES, write_samples
from renderer.scene import load_scene
from renderer.usd.licence import authored_licence
from schemas.licence import commercial_use
from schemas.scene import SceneArrays


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("samples")
    write_samples(place)
    return place


@pytest.fixture(scope="module")
def scenes(folder: Path) -> dict[str, SceneArrays]:
    return {file.stem: load_scene(file) for file in sorted(folder.glob("*.usd?"))}


def test_bytes_are_the_same_every_time(folder: Path, tmp_path: Path) -> None:
    assert len(write_samples(tmp_path)) == len(SAMPLES) >= 8
    ours = {p.relative_to(tmp_path): p.read_bytes() for p in tmp_path.rglob("*.*")}
    theirs = {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*.*")}
    assert ours == theirs


def test_files_are_small(folder: Path) -> None:
    sizes = {p.name: p.stat().st_size for p in folder.rglob("*.*")}
    assert max(sizes.values()) < 2_000_000, sizes


def test_every_scene_states_a_licence_that_allows_commercial_use(folder: Path) -> None:
    stages = sorted(folder.glob("*.usd?"))
    assert {file.stem: commercial_use(authored_licence(file)) for file in stages} == dict.fromkeys(SAMPLES, "allowed")


def test_every_scene_is_transparent_has_cameras_and_loads_without_warnings(scenes: dict[str, SceneArrays]) -> None:
    assert set(scenes) == set(SAMPLES)
    for name, scene in scenes.items():
        assert scene.warnings == (), name
        assert not scene.is_opaque, name
        assert 2 <= len(scene.cameras) <= 3, name
        assert 10_000 <= scene.triangles <= 150_000, (name, scene.triangles)
        assert len(np.unique(scene.colours[:, 3])) > 2 or scene.textures, f"{name} has one opacity"
        assert any(batch.layer == "opaque" for batch in scene.batches), f"{name} has no opaque surface"


def test_the_samples_cover_axes_units_textures_and_cut_outs(scenes: dict[str, SceneArrays]) -> None:
    assert any(s.up == (0.0, 0.0, 1.0) and s.metres_per_unit == 0.01 for s in scenes.values())
    assert any(b.opacity_threshold > 0 for s in scenes.values() for b in s.batches)
    assert any(b.layer == "mixed" and b.opacity_threshold == 0 for s in scenes.values() for b in s.batches)


def test_no_point_instancer_draws_a_class_of_which_storm_shows_nothing(folder: Path) -> None:
    stages = [Usd.Stage.Open(str(file)) for file in sorted(folder.glob("*.usd?"))]
    instancers = [UsdGeom.PointInstancer(prim) for stage in stages for prim in stage.Traverse()]
    kinds = [
        instancer.GetPrim().GetStage().GetPrimAtPath(path)
        for instancer in instancers
        if instancer
        for path in instancer.GetPrototypesRel().GetTargets()
    ]
    assert kinds
    # Nor are they drawn where they stand.
    assert all(not kind.IsAbstract() and not kind.IsDefined() for kind in kinds)
