"""Opacities drawn for every material of a scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from renderer.opacities import BASE_ALPHA, OPACITIES, drawn_opacities
from renderer.samples import write_samples
from renderer.scene import LoadOptions, load_scene
from schemas.scene import Batch, SceneArrays

LEVELS = {round(255 * opacity) for opacity in OPACITIES}
RED, NEAR_RED, GREEN = (200, 10, 10), (203, 12, 10), (10, 200, 10)


def _scene(*batches: Batch) -> SceneArrays:
    """For each batch six triangles, two each of red, of nearly the same red, and of green."""
    colours = np.repeat([[*c, 128] for c in (RED, NEAR_RED, GREEN)] * len(batches), 6, axis=0).astype(np.uint8)
    vertices = len(colours)
    empty = np.zeros((vertices, 3), np.float32)
    return SceneArrays(
        name="materials",
        positions=empty,
        normals=empty,
        uvs=empty[:, :2],
        colours=colours,
        indices=np.arange(vertices, dtype=np.uint32),
        batches=tuple(replace(batch, first=18 * i, count=18) for i, batch in enumerate(batches)),
        textures=(),
        origin=np.zeros(3),
        bounds=np.zeros((2, 3)),
        up=(0.0, 1.0, 0.0),
        metres_per_unit=1.0,
    )


TRANSPARENT = Batch(0, 0, "transparent")


def test_a_material_has_one_opacity_of_its_own() -> None:
    scene = _scene(*[TRANSPARENT] * 40)
    drawn = drawn_opacities(scene, seed=1)
    alpha = drawn.colours[:, 3].reshape(40, 18)
    reds, greens = alpha[:, :12], alpha[:, 12:]
    assert (reds == reds[:, :1]).all()
    assert (greens == greens[:, :1]).all()
    assert set(alpha.ravel().tolist()) == LEVELS
    assert (reds[:, 0] != greens[:, 0]).any()
    assert np.array_equal(drawn.colours[:, :3], scene.colours[:, :3])
    assert (scene.colours[:, 3] == 128).all(), "the scene itself stays as it was"


def test_equal_seeds_give_equal_scenes() -> None:
    scene = _scene(*[TRANSPARENT] * 4)
    first, again, other = (drawn_opacities(scene, seed).colours for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_cut_outs_keep_their_shape_and_opaque_batches_are_left() -> None:
    cut_out = Batch(0, 0, "mixed", opacity_threshold=0.5, cut_out_alpha=BASE_ALPHA)
    scene = _scene(*[cut_out] * 20, Batch(0, 0, "opaque"))
    drawn = drawn_opacities(scene, seed=1)
    assert np.array_equal(drawn.colours, scene.colours)
    *cut, opaque = drawn.batches
    assert {batch.cut_out_alpha for batch in cut} <= set(OPACITIES)
    assert len({batch.cut_out_alpha for batch in cut}) > 3
    assert {replace(batch, cut_out_alpha=BASE_ALPHA, first=0) for batch in cut} == {replace(cut_out, count=18)}
    assert opaque == scene.batches[-1]


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_samples(tmp_path_factory.mktemp("samples"))


def test_in_the_samples_everything_stays_transparent(samples: list[Path]) -> None:
    several = 0
    for path in samples:
        scene = load_scene(path, LoadOptions(alpha=BASE_ALPHA))
        drawn = drawn_opacities(scene, seed=7)
        changed = drawn.colours[:, 3] != scene.colours[:, 3]
        assert set(np.unique(drawn.colours[changed, 3]).tolist()) <= LEVELS
        assert [batch.layer for batch in drawn.batches] == [batch.layer for batch in scene.batches]
        several += len(np.unique(drawn.colours[:, 3])) > 1
    assert several > len(samples) // 3
