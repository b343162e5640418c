"""Frustum culling against all vertices: nothing that touches the frustum is left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from support.scenes import shells

from renderer.culling import CLUSTER, Clusters
from schemas.scene import SceneArrays
from schemas.view import View

SCENE = shells(subdivisions=3)


def _inside(scene: SceneArrays, clip: np.ndarray) -> np.ndarray:
    """bool [T]: triangles with a vertex inside the frustum."""
    position = clip @ np.concatenate([scene.positions.astype(np.float64), np.ones((len(scene.positions), 1))], axis=1).T
    inside = (np.abs(position[:3]) <= position[3]).all(axis=0)
    return np.asarray(inside[scene.indices].reshape(-1, 3).any(axis=1))


@given(
    st.tuples(*[st.floats(-4, 4)] * 3),
    st.floats(2.0, 120.0),
    st.booleans(),
    st.floats(0.3, 3.0),
)
def test_every_triangle_with_a_vertex_in_the_frustum_is_drawn(
    eye: tuple[float, float, float], fov: float, parallel: bool, aspect: float
) -> None:
    target = (0.3, -0.2, 0.1)
    if (
        np.linalg.norm(np.subtract(eye, target)) < 0.1
        or np.linalg.norm(np.cross(np.subtract(eye, target), (0, 1, 0))) < 0.1
    ):
        return
    view = View(name="v", eye=eye, target=target, up=(0, 1, 0), fov=fov, ortho_height=fov / 40 if parallel else None)
    projection, to_view = view.projection(aspect, *view.clip_range(SCENE.bounds)), view.world_to_view()
    ranges, left_out = Clusters(SCENE).visible(projection, to_view)
    drawn = np.zeros(len(SCENE.indices) // 3, dtype=int)
    for runs in ranges:
        for first, count in runs:
            drawn[first : first + count] += 1
    assert drawn.max() <= 1
    assert drawn[_inside(SCENE, projection @ to_view)].all()
    assert drawn.sum() + left_out == len(drawn)


def test_runs_stay_inside_their_batches() -> None:
    clusters = Clusters(SCENE)
    view = View(name="v", eye=(0, 0, 9), target=(0, 0, 0), up=(0, 1, 0))
    ranges, left_out = clusters.visible(view.projection(1.0, 0.1, 99.0), view.world_to_view())
    assert left_out == 0
    assert ranges == [[(b.first // 3, b.count // 3)] for b in SCENE.batches]
    assert max(b.count // 3 for b in SCENE.batches) > 2 * CLUSTER


def test_a_scene_without_triangles_has_no_clusters() -> None:
    empty = replace(SCENE, batches=(), indices=np.zeros(0, dtype=np.uint32))
    assert Clusters(empty).visible(np.eye(4), np.eye(4)) == ([], 0)
