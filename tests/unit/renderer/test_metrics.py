from __future__ import annotations

import flip_evaluator
import numpy as np
import pytest

from renderer.metrics import PIXELS_PER_DEGREE, flip, mse, psnr, ssim

RNG = np.random.default_rng(5)
REFERENCE = RNG.integers(0, 256, (120, 160, 3)).astype(np.uint8)


def changed(rows: slice, columns: slice) -> np.ndarray:
    test = REFERENCE.copy()
    test[rows, columns] = RNG.integers(0, 256, test[rows, columns].shape)
    return test


@pytest.mark.parametrize(
    ("rows", "columns"), [(slice(50, 58), slice(70, 73)), (slice(0, 3), slice(150, 160)), (slice(None), slice(None))]
)
def test_flip_of_the_differing_part_is_that_of_the_whole(rows: slice, columns: slice) -> None:
    test = changed(rows, columns)
    mean, error_map = flip(test, REFERENCE)
    whole, whole_mean, _ = flip_evaluator.evaluate(
        REFERENCE.astype(np.float32) / 255,
        test.astype(np.float32) / 255,
        "LDR",
        applyMagma=False,
        parameters={"ppd": PIXELS_PER_DEGREE},
    )
    np.testing.assert_allclose(error_map, np.asarray(whole).reshape(error_map.shape), atol=1e-6)
    assert mean == pytest.approx(whole_mean, rel=1e-5)


def test_equal_pictures_have_no_error() -> None:
    mean, error_map = flip(REFERENCE, REFERENCE)
    assert mean == 0.0
    assert not error_map.any()
    assert mse(REFERENCE, REFERENCE) == 0.0
    assert psnr(0.0) == float("inf")


def test_mse_is_the_mean_over_pixels_and_channels_in_unit_range() -> None:
    test = REFERENCE.copy()
    test[0, 0, 0] = 255 - test[0, 0, 0]
    step = abs(int(test[0, 0, 0]) - int(REFERENCE[0, 0, 0])) / 255
    assert mse(test, REFERENCE) == pytest.approx(step**2 / REFERENCE.size)
    assert psnr(0.01) == pytest.approx(20.0)


def test_pictures_of_different_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="one size"):
        flip(REFERENCE[1:], REFERENCE)


def plain_ssim(test: np.ndarray, reference: np.ndarray) -> float:
    """Equation 13 of Wang et al. 2004, window by window."""
    grey = [image.astype(np.float64) @ (0.299, 0.587, 0.114) for image in (test, reference)]
    line = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    weight = np.outer(line, line) / line.sum() ** 2
    found = []
    for row in range(test.shape[0] - 10):
        for column in range(test.shape[1] - 10):
            x, y = (image[row : row + 11, column : column + 11] for image in grey)
            mx, my = (weight * x).sum(), (weight * y).sum()
            vx, vy = (weight * (x - mx) ** 2).sum(), (weight * (y - my) ** 2).sum()
            cov = (weight * (x - mx) * (y - my)).sum()
            c1, c2 = 2.55**2, 7.65**2
            found.append((2 * mx * my + c1) * (2 * cov + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2)))
    return float(np.mean(found))


@pytest.mark.parametrize(
    ("rows", "columns"), [(slice(20, 24), slice(30, 33)), (slice(0, 2), slice(38, 40)), (slice(None), slice(None))]
)
def test_ssim_is_that_of_its_definition(rows: slice, columns: slice) -> None:
    reference, test = REFERENCE[:50, :40], changed(rows, columns)[:50, :40]
    assert ssim(test, reference) == pytest.approx(plain_ssim(test, reference), abs=1e-12)
    assert ssim(test, reference) == pytest.approx(ssim(reference, test), abs=1e-12)
    assert ssim(test, reference) < 1.0


def test_equal_pictures_are_similar_and_small_ones_refused() -> None:
    assert ssim(REFERENCE, REFERENCE) == 1.0
    with pytest.raises(ValueError, match="one size"):
        ssim(REFERENCE[:10], REFERENCE[:10])
