"""VKB's importance factor by factor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from renderer.allocation.importance import VkbOptions, vkb_importance

NONE = VkbOptions(depth=False, periphery=False, fresnel=False, noise=0.0)
WIDTH, HEIGHT = 40, 30
P = WIDTH * HEIGHT
N = np.arange(P) % 31
FACING = (np.arange(P) % 256).astype(np.uint8)


def importance(options: VkbOptions, n: np.ndarray = N) -> np.ndarray:
    return vkb_importance(n, FACING, WIDTH, HEIGHT, options)


def test_depth_complexity_rises_up_to_its_limit() -> None:
    values = importance(replace(NONE, depth=True))
    np.testing.assert_allclose(values[1:31], 0.25 + 0.75 * np.minimum(1.0, N[1:31] / 20), rtol=1e-6)


def test_the_periphery_is_darker_than_the_centre() -> None:
    values = importance(replace(NONE, periphery=True), np.ones(P, int)).reshape(HEIGHT, WIDTH)
    assert values[15, 20] == pytest.approx(1.0, abs=1e-3)
    corner = np.hypot(19.5, 14.5) / (1.1 * 25.0)
    assert values[0, 0] == pytest.approx(1.0 - corner**3, rel=1e-5)


def test_grazing_surfaces_count_half() -> None:
    values = importance(replace(NONE, fresnel=True), np.ones(P, int))
    assert values[0] == 0.5
    assert values[255] == 1.0
    assert np.all(np.diff(values[:256]) >= 0.0)


def test_noise_is_seeded_and_small() -> None:
    options = replace(NONE, noise=0.1)
    first, other = importance(options), importance(replace(options, seed=1))
    assert np.array_equal(first, importance(options))
    assert not np.array_equal(first, other)
    assert np.abs(first[N > 0] - 1.0).max() <= 0.05


def test_pixels_without_fragments_have_none() -> None:
    assert not importance(VkbOptions())[N == 0].any()
    assert importance(VkbOptions()).min() >= 0.0


def test_the_thesis_leaves_fresnel_out_and_reaches_further() -> None:
    values = vkb_importance(np.full(P, 30), np.zeros(P, np.uint8), WIDTH, HEIGHT, replace(VkbOptions.thesis(), noise=0))
    corner = np.hypot(19.5, 14.5) / 50.0
    assert values[0] == pytest.approx(1.0 - corner**3, rel=1e-5)
