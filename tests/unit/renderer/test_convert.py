from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attacks import glbs, make

from renderer.convert import stage_file
from renderer.scene import load_scene
from schemas.problem import Problem
from schemas.scene import SceneArrays


def _loaded(tmp_path: Path, data: bytes) -> SceneArrays:
    (tmp_path / "a.glb").write_bytes(data)
    return load_scene(stage_file(tmp_path, "a.glb", tmp_path / "cache"))


def test_what_is_no_glb_is_opened_as_it_is(tmp_path: Path) -> None:
    assert stage_file(tmp_path, "a.usdz", tmp_path / "cache") == tmp_path / "a.usdz"
    assert not (tmp_path / "cache").exists()


def test_a_transparent_triangle_is_where_it_was_and_as_transparent(tmp_path: Path) -> None:
    scene = _loaded(tmp_path, glbs.glb(glbs.document()))
    assert scene.triangles == 1
    assert [batch.layer for batch in scene.batches] == ["transparent"]
    # 0.5 of 255, rounded up; red in full.
    assert scene.colours.tolist() == [[255, 0, 0, 128]] * 3
    corners = scene.positions[scene.indices] + scene.origin
    np.testing.assert_allclose(sorted(corners.tolist()), sorted([[0, 1, 0], [1, 1, 0], [0, 2, 0]]), atol=1e-6)
    assert scene.warnings == ()


def test_instances_stand_where_another_reader_puts_them(tmp_path: Path) -> None:
    data = glbs.good(make.png())["instances.glb"]
    scene = _loaded(tmp_path, data)
    other = trimesh.load(tmp_path / "a.glb", force="scene")
    np.testing.assert_allclose(scene.bounds + scene.origin, other.bounds, atol=1e-6)
    assert scene.triangles == 2


@pytest.mark.parametrize("name", ["texture.glb", "texture-data.glb"])
def test_an_image_is_sampled_as_the_file_says(tmp_path: Path, name: str) -> None:
    scene = _loaded(tmp_path, glbs.good(make.png())[name])
    assert len(scene.textures) == 1
    assert scene.textures[0].srgb
    assert scene.textures[0].wrap == ("clamp", "repeat")
    assert (scene.textures[0].pixels[..., 0] == 128).all()
    # glTF counts v downwards, USD upwards.
    assert sorted(scene.uvs.tolist()) == [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0]]


@pytest.mark.parametrize(("mode", "alpha", "layer"), [("OPAQUE", 255, "opaque"), ("MASK", 255, "opaque")])
def test_alpha_counts_as_its_mode_says(tmp_path: Path, mode: str, alpha: int, layer: str) -> None:
    document = glbs.document()
    document["materials"][0] |= {"alphaMode": mode, "alphaCutoff": 0.25}
    scene = _loaded(tmp_path, glbs.glb(document))
    assert scene.colours[0, 3] == alpha
    assert scene.batches[0].layer == layer


def test_a_fan_and_a_strip_keep_the_side_that_is_out(tmp_path: Path) -> None:
    for mode in (5, 6):
        document = glbs.document()
        document["meshes"][0]["primitives"][0]["mode"] = mode
        scene = _loaded(tmp_path, glbs.glb(document))
        assert scene.triangles == 1
        a, b, c = scene.positions[scene.indices]
        assert np.cross(b - a, c - a)[2] > 0


def test_the_same_file_makes_the_same_bytes_once(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(glbs.good(make.png())["texture.glb"])
    first = stage_file(tmp_path, "a.glb", tmp_path / "one")
    second = stage_file(tmp_path, "a.glb", tmp_path / "two")
    assert first.read_bytes() == second.read_bytes()
    assert first.relative_to(tmp_path / "one") == second.relative_to(tmp_path / "two")
    made = first.stat().st_mtime_ns
    assert stage_file(tmp_path, "a.glb", tmp_path / "one") == first
    assert first.stat().st_mtime_ns == made
    assert sorted(path.name for path in first.parent.iterdir()) == ["a.usdc", "image0.png"]


def test_what_is_damaged_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(glbs.glb(json.dumps({"scenes": 7}).encode()))
    with pytest.raises(Problem):
        stage_file(tmp_path, "a.glb", tmp_path / "cache")
    assert list((tmp_path / "cache").iterdir()) == []
