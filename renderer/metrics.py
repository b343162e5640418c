"""Errors between two pictures, as the field reports them: 8-bit sRGB, whole image."""

from __future__ import annotations

import flip_evaluator
import numpy as np
from numpy.typing import NDArray

PIXELS_PER_DEGREE = 67.02
"""FLIP's default viewer: 0.7 m from a screen of 0.7 m and 3840 pixels."""

_REACH = 24
"""Pixels, more than twice the radius of FLIP's largest filter (3 x .045 degrees)."""

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
    """The rectangle outside which FLIP is exactly 0; None if the pictures are equal.

    FLIP's filters reach 10 pixels at 67 pixels per degree; twice that keeps the rectangle's own border, where the
    filters repeat the last pixel, away from everything that differs.
    """
    different = (test != reference).any(axis=2)
    rows, columns = np.flatnonzero(different.any(axis=1)), np.flatnonzero(different.any(axis=0))
    if len(rows) == 0:
        return None
    low = [max(0, int(along[0]) - _REACH) for along in (rows, columns)]
    high = [int(along[-1]) + 1 + _REACH for along in (rows, columns)]
    return slice(low[0], high[0]), slice(low[1], high[1])
