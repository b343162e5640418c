"""Views: cameras, views files, sampling."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.scenes import VIEW, shells
from support.stages import stage, triangle

from renderer.rooms import find_room
from renderer.scene import load_scene
from renderer.views import ASPECT, listed_views, placed_views, sampled_views, scene_views
from schemas.problem import ExitCode, Problem
from schemas.scene import Batch, SceneArrays


def scene_of(mesh: trimesh.Trimesh) -> SceneArrays:
    points = np.asarray(mesh.vertices, dtype=np.float32)
    indices = np.asarray(mesh.faces, dtype=np.uint32).ravel()
    return dataclasses.replace(
        shells(1, 1, 0),
        positions=points,
        indices=indices,
        bounds=np.stack((points.min(0), points.max(0))).astype(np.float64),
        batches=(Batch(0, len(indices), "opaque"),),
    )


def test_cameras_of_the_stage_come_first_and_no_more_than_asked_for() -> None:
    cameras = tuple(VIEW.model_copy(update={"name": n}) for n in "abc")
    scene = dataclasses.replace(shells(), cameras=cameras)
    assert scene_views(scene, 2, seed=0) == cameras[:2]


def test_samples_are_the_same_for_the_same_seed_and_named_uniquely() -> None:
    scene = shells()
    assert sampled_views(scene, 6, 4) == sampled_views(scene, 6, 4)
    assert sampled_views(scene, 6, 4) != sampled_views(scene, 6, 5)
    assert len({v.name for v in sampled_views(scene, 6, 4)}) == 6
    assert sampled_views(scene, 3, 4) == sampled_views(scene, 6, 4)[:3], "more views keep the first ones"


@pytest.mark.parametrize("size", [(1, 1, 1), (10, 1, 1), (1, 1, 30), (1e-4, 1e-4, 1e-4), (1e5, 3e4, 1e5)])
def test_sampled_views_fill_the_frame_with_the_object(size: tuple[float, float, float]) -> None:
    scene = scene_of(trimesh.creation.icosphere(3).apply_scale(size))
    for view in sampled_views(scene, 8, 1):
        near, far = view.clip_range(scene.bounds)
        clip = view.projection(ASPECT, near, far) @ view.world_to_view()
        points = np.c_[scene.positions, np.ones(len(scene.positions))] @ clip.T
        assert np.all(points[:, 3] > 0)
        window = points[:, :2] / points[:, 3:]
        assert 0.7 < np.abs(window).max() < 1.5


def test_a_flat_and_a_single_point_like_scene_still_have_views() -> None:
    flat = scene_of(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]], process=False))
    assert np.isfinite([v.world_to_view() for v in sampled_views(flat, 4, 0)]).all()


def _hall() -> trimesh.Trimesh:
    """A floor, four walls and two rows of columns."""
    pieces = [trimesh.creation.box((10, 0.2, 6))]
    for x, z, size in ((-5, 0, (0.2, 4, 6)), (5, 0, (0.2, 4, 6)), (0, -3, (10, 4, 0.2)), (0, 3, (10, 4, 0.2))):
        pieces.append(trimesh.creation.box(size).apply_translation((x, 2, z)))
    for z in (-1.8, 1.8):
        pieces.extend(trimesh.creation.box((0.6, 4, 0.4)).apply_translation((x, 2, z)) for x in range(-4, 5, 1))
    for x in (-3.5, 3.5):
        pieces.append(trimesh.creation.box((0.3, 4, 3)).apply_translation((x, 2, 0)))
    return trimesh.util.concatenate(pieces)


def test_a_hall_has_a_room_and_views_in_it_while_objects_have_none() -> None:
    hall = scene_of(_hall())
    room = find_room(hall)
    assert room is not None
    assert np.all((room.places > hall.bounds[0]) & (room.places < hall.bounds[1]))
    eye = np.array(sampled_views(hall, 2, 0)[1].eye)
    assert np.all((eye > hall.bounds[0]) & (eye < hall.bounds[1]))
    assert find_room(scene_of(trimesh.creation.icosphere(3))) is None
    assert find_room(scene_of(trimesh.creation.box())) is None


def _listing(folder: Path, **view: object) -> Path:
    file = folder / "views.json"
    entry = {"eye": [0, 0, 100], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 50, "stats": {"x": 1}} | view
    file.write_text(json.dumps({"conventions": "", "scenes": [{"main": "scene.usda", "name": "s", "views": [entry]}]}))
    return file


def test_listed_views_are_converted_to_metres_around_the_origin(tmp_path: Path) -> None:
    path = stage(tmp_path, triangle(), "metersPerUnit = 0.01")
    scene = load_scene(path)
    (view,) = placed_views(listed_views(_listing(tmp_path), path), scene)
    np.testing.assert_allclose(np.array(view.eye) + scene.origin, (0, 0, 1.0))
    assert view.fov == 50
    assert listed_views(_listing(tmp_path), tmp_path / "other.usda") == ()


@pytest.mark.parametrize(
    "text", ["", "[]", '{"scenes": 3}', '{"scenes": [{"main": "scene.usda", "views": [{"eye": [0, 0]}]}]}', "\xff"]
)
def test_a_views_file_of_another_form_is_a_problem(tmp_path: Path, text: str) -> None:
    file = tmp_path / "views.json"
    file.write_text(text, encoding="latin-1")
    with pytest.raises(Problem, match="not a views file"):
        listed_views(file, tmp_path / "scene.usda")


def test_a_missing_views_file_and_a_view_without_direction_are_problems(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="no views file") as caught:
        listed_views(tmp_path / "absent.json", tmp_path / "scene.usda")
    assert caught.value.code == ExitCode.NOT_FOUND
    listed = listed_views(_listing(tmp_path, target=[0, 0, 100]), tmp_path / "scene.usda")
    with pytest.raises(Problem, match="no view"):
        placed_views(listed, shells())
