"""Errors between two pictures, as the field reports them: 8-bit sRGB, whole image."""

from __future__ import annotations

import flip_evaluator
import numpy as np
from numpy.typing import NDArray

from renderer.reference.flip import PIXELS_PER_DEGREE

_REACH = 24
"""Pixels, more than twice the radius of FLIP's largest filter (3 x .045 degrees)."""

_WINDOW, _SIGMA = 11, 1.5
"""SSIM's Gaussian window (Wang et al. 2004, section III-B)."""
_STABILITY = ((0.01 * 255.0) ** 2, (0.03 * 255.0) ** 2)
"""C1 and C2 of equation 13 there, for 8-bit values."""
_LUMA = (0.299, 0.587, 0.114)
"""Of sRGB values (ITU-R BT.601), as the authors' own code takes grey values."""

Image8 = NDArray[np.uint8]


def mse(test: Image8, reference: Image8) -> float:
    """Mean squared error over pixels and channels, values in [0,1].

    Args:
        test: uint8 [H, W, 3], sRGB.
        reference: The same shape.
    """
    difference = test.astype(np.int32) - reference.astype(np.int32)
    return float(np.mean(difference * difference)) / 255.0**2


def psnr(error: float) -> float:
    """Peak signal-to-noise ratio, dB, of a mean squared error; infinite for none."""
    return float("inf") if error == 0.0 else float(-10.0 * np.log10(error))


def ssim(test: Image8, reference: Image8) -> float:
    """Structural similarity (Wang et al. 2004, equation 13): mean over all windows that lie in the image, of its luma.

    Args:
        test: uint8 [H, W, 3], sRGB, at least 11 pixels either way.
        reference: The same shape.

    Raises:
        ValueError: The shapes differ or are too small.
    """
    if test.shape != reference.shape or test.ndim != 3 or min(test.shape[:2]) < _WINDOW:
        raise ValueError(f"SSIM compares two pictures of one size, not {test.shape} and {reference.shape}")
    part = _differing_part(test, reference)
    if part is None:
        return 1.0
    # Windows of equal pixels are 1: only those that can differ are computed.
    x, y = (image[part].astype(np.float64) @ np.array(_LUMA) for image in (test, reference))
    mean_x, mean_y = _windowed(x), _windowed(y)
    variance_x, variance_y = _windowed(x * x) - mean_x**2, _windowed(y * y) - mean_y**2
    covariance = _windowed(x * y) - mean_x * mean_y
    first, second = _STABILITY
    similar = (2.0 * mean_x * mean_y + first) * (2.0 * covariance + second)
    similar /= (mean_x**2 + mean_y**2 + first) * (variance_x + variance_y + second)
    windows: int = (test.shape[0] - _WINDOW + 1) * (test.shape[1] - _WINDOW + 1)
    lost = float(np.sum(1.0 - similar))
    return 1.0 - lost / windows


def _windowed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Gaussian means of all windows inside, float64 [H - 10, W - 10] of [H, W]."""
    taps = np.exp(-0.5 * (np.arange(_WINDOW) - _WINDOW // 2) ** 2 / _SIGMA**2)
    taps /= taps.sum()
    rows = values.shape[0] - _WINDOW + 1
    columns = values.shape[1] - _WINDOW + 1
    down, out = np.zeros((rows, values.shape[1])), np.zeros((rows, columns))
    for i, tap in enumerate(taps):
        down += tap * values[i : i + rows]
    for i, tap in enumerate(taps):
        out += tap * down[:, i : i + columns]
    return out


def flip(test: Image8, reference: Image8) -> tuple[float, NDArray[np.float32]]:
    """LDR-FLIP (Andersson et al. 2020) at 67.02 pixels per degree.

    Args:
        test: uint8 [H, W, 3], sRGB.
        reference: The same shape.

    Returns:
        Mean over the image, and the error map, float32 [H, W] in [0,1].

    Raises:
        ValueError: The shapes differ. (The library itself would end the process.)
    """
    if test.shape != reference.shape or test.ndim != 3 or test.shape[2] != 3:
        raise ValueError(f"FLIP compares two RGB pictures of one size, not {test.shape} and {reference.shape}")
    error_map = np.zeros(test.shape[:2], dtype=np.float32)
    part = _differing_part(test, reference)
    if part is None:
        return 0.0, error_map
    as_float = [np.ascontiguousarray(image[part], dtype=np.float32) / np.float32(255.0) for image in (reference, test)]
    parameters = {"ppd": PIXELS_PER_DEGREE}
    error, _, _ = flip_evaluator.evaluate(*as_float, "LDR", applyMagma=False, parameters=parameters)
    error_map[part] = np.asarray(error, dtype=np.float32).reshape(error_map[part].shape)
    return float(error_map.mean(dtype=np.float64)), error_map


def _differing_part(test: Image8, reference: Image8) -> tuple[slice, slice] | None:
    """The rectangle outside which FLIP is exactly 0 and SSIM 1; None if the pictures are equal.

    FLIP's filters reach 10 pixels at 67 pixels per degree, SSIM's window 5; twice that keeps the rectangle's own
    border, where FLIP's filters repeat the last pixel, away from everything that differs.
    """
    different = (test != reference).any(axis=2)
    rows, columns = np.flatnonzero(different.any(axis=1)), np.flatnonzero(different.any(axis=0))
    if len(rows) == 0:
        return None
    low = [max(0, int(along[0]) - _REACH) for along in (rows, columns)]
    high = [int(along[-1]) + 1 + _REACH for along in (rows, columns)]
    return slice(low[0], high[0]), slice(low[1], high[1])
