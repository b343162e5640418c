"""Errors between two pictures, as the field reports them: 8-bit sRGB, whole image."""

from __future__ import annotations

import flip_evaluator
import numpy as np
from numpy.typing import NDArray

PIXELS_PER_DEGREE = 67.02
"""FLIP's default viewer: 0.7 m from a screen of 0.7 m and 3840 pixels."""

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
    as_float = [np.ascontiguousarray(image, dtype=np.float32) / np.float32(255.0) for image in (reference, test)]
    parameters = {"ppd": PIXELS_PER_DEGREE}
    error, mean, _ = flip_evaluator.evaluate(*as_float, "LDR", applyMagma=False, parameters=parameters)
    return float(mean), np.asarray(error, dtype=np.float32).reshape(test.shape[:2])
