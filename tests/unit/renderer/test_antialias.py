from __future__ import annotations

import numpy as np
import pytest

from renderer.antialias import SAMPLES, positions, sample_views
from schemas.view import View

VIEW = View(name="v", eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), shift=(0.1, -0.2))


@pytest.mark.parametrize("samples", SAMPLES)
def test_samples_have_rows_and_columns_of_their_own_about_the_centre(samples: int) -> None:
    found = positions(samples)
    assert found.shape == (samples, 2)
    assert np.allclose(found.mean(axis=0), 0.0)
    for axis in range(2):
        cells = np.floor((found[:, axis] + 0.5) * samples).astype(int)
        assert sorted(cells) == list(range(samples))


def test_a_sample_is_so_far_from_the_pixels_centre() -> None:
    width, height = 60, 40
    point = np.array([0.3, 0.2, 1.0, 1.0])

    def pixel(view: View) -> np.ndarray:
        clip = view.projection(width / height, 0.1, 10.0) @ view.world_to_view() @ point
        return 0.5 * clip[:2] / clip[3] * (width, height)

    moved = [pixel(VIEW) - pixel(view) for view in sample_views(VIEW, height, 8)]
    assert np.allclose(moved, positions(8))
    assert sample_views(VIEW, height, 1) == [VIEW]
