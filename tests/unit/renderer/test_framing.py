"""The view of a scene without cameras."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.scenes import shells

from renderer.views import FRAMING_ASPECT, framing_view
from schemas.scene import SceneArrays


@pytest.mark.parametrize(("up", "front"), [((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), ((0.0, 0.0, 1.0), (0.0, -1.0, 0.0))])
@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (9.0, 0.5, 1.0), (0.2, 6.0, 0.2), (1.0, 0.01, 8.0)])
def test_the_whole_scene_fills_the_frame_from_the_front(
    up: tuple[float, float, float], front: tuple[float, float, float], stretch: tuple[float, float, float]
) -> None:
    scene = stretched(up, stretch)
    view = framing_view(scene)
    to_view = view.world_to_view()
    assert to_view[2, :3] @ np.array(front) > 0.8
    assert to_view[1, :3] @ np.array(up) > 0.9
    clip_from = view.projection(FRAMING_ASPECT, *view.clip_range(scene.bounds)) @ to_view
    clip = np.column_stack((scene.positions, np.ones(len(scene.positions)))) @ clip_from.T
    window = np.abs(clip[:, :2] / clip[:, 3:])
    assert (clip[:, 3] > 0).all()
    # Not every vertex is looked at, so one may be a little outside.
    assert 0.75 < window.max() < 1.02


@pytest.mark.parametrize("flat", [0, 1, 2])
def test_no_side_of_a_box_is_seen_edge_on(flat: int) -> None:
    view = framing_view(stretched((0.0, 1.0, 0.0), (1.0, 1.0, 1.0)))
    assert abs(view.world_to_view()[2, flat]) > 0.3


def stretched(up: tuple[float, float, float], stretch: tuple[float, float, float]) -> SceneArrays:
    scene = shells()
    positions = (scene.positions * np.array(stretch)).astype(np.float32)
    bounds = np.stack((positions.min(axis=0), positions.max(axis=0))).astype(np.float64)
    return dataclasses.replace(scene, up=up, positions=positions, bounds=bounds)
