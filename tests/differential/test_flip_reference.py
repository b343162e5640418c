"""FLIP in plain numpy against the library's, on pictures that differ a little, much, and nowhere."""

from __future__ import annotations

import numpy as np
import pytest

from renderer import metrics
from renderer.reference.flip import flip


@pytest.mark.parametrize("strength", [0, 2, 40, 255])
def test_maps_agree(strength: int) -> None:
    rng = np.random.default_rng(strength)
    reference = rng.integers(0, 256, (60, 70, 3)).astype(np.uint8)
    reference[:, 35:] = np.linspace(0, 255, 35).astype(np.uint8)[None, :, None]
    noise = rng.integers(-strength, strength + 1, reference.shape)
    noise[:20] = 0
    test = np.clip(reference.astype(np.int64) + noise, 0, 255).astype(np.uint8)
    _, expected = metrics.flip(test, reference)
    found = flip(test, reference)
    assert (strength == 0) == (found.max() == 0.0)
    np.testing.assert_allclose(found, expected, atol=2e-4)


def test_colours_far_apart_are_near_one() -> None:
    reference, test = np.zeros((2, 40, 40, 3), dtype=np.uint8)
    reference[..., 1], test[..., 2] = 255, 255
    found = flip(test, reference)
    assert found[20, 20] == pytest.approx(metrics.flip(test, reference)[1][20, 20], abs=2e-4)
    assert found[20, 20] > 0.99
