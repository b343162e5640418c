"""Twin of `moment`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.reference.pixels import Floats, Pixel, picture_of
from renderer.techniques.moment import BIAS, OVERESTIMATION
from schemas.fragments import FragmentDump

_SPREAD = np.array([1.0, 0.0, 0.375, 0.0, 0.375])
"""Moments of degree 0 to 4 towards which the bias goes."""

_FAR = 1e6
"""Points of a representation farther away than this have no mass that a float64 shows."""


def warped(depth: NDArray[np.float32]) -> Floats:
    """Where depths lie between their least and greatest, on a logarithmic scale, float64 [n] in [-1, 1].

    Args:
        depth: float32 [n], view-space distances of a pixel's fragments, metres, > 0; n >= 1.
    """
    logs = np.log(depth.astype(np.float64))
    extent = logs.max() - logs.min()
    return np.asarray(2.0 * (logs - logs.min()) / extent - 1.0) if extent > 0.0 else np.full(len(depth), -1.0)


def share_before(absorbance: Floats, x: Floats, bias: float = BIAS, overestimation: float = OVERESTIMATION) -> Floats:
    """The share of the absorbance in front of each fragment that the moments give, float64 [n].

    Args:
        absorbance: float64 [n], > 0.
        x: float64 [n], warped depths.
        bias: Of the moments.
        overestimation: Share of the mass at a fragment's own depth that counts as in front of it.
    """
    powers = x[:, None] ** np.arange(5)
    moments = (1.0 - bias) * (absorbance @ powers) / absorbance.sum() + bias * _SPREAD
    hankel = moments[np.add.outer(np.arange(3), np.arange(3))]
    inverse = np.linalg.inv(hankel)  # K(x, y) = (1, x, x^2) inverse (1, y, y^2)^T
    mass = _mass(x, inverse)
    low, high = _roots(powers[:, :3] @ inverse)
    # Two points may be close to each other, but only on one side of x.
    before = np.where(high < x, 1.0 - mass, np.where(low < x, _mass(low, inverse), 0.0))
    return np.asarray(before + overestimation * mass)


def picture(dump: FragmentDump, bias: float = BIAS, overestimation: float = OVERESTIMATION) -> Floats:
    """The picture, float64 [P, 3], linear RGB.

    Args:
        dump: Fragments of a view.
        bias: Of the moments.
        overestimation: Share of the mass at a fragment's own depth that counts as in front of it.
    """

    def colour(pixel: Pixel) -> Floats:
        absorbance = -np.log1p(-pixel.alpha)
        depth = absorbance.sum() * share_before(absorbance, warped(pixel.depth), bias, overestimation)
        return pixel.mean(pixel.alpha * np.exp(depth.min() - depth), float(np.prod(1.0 - pixel.alpha)))

    return picture_of(dump, colour)


def _mass(y: Floats, inverse: Floats) -> Floats:
    """1 / K(y, y), float64 [n]."""
    powers = y[:, None] ** np.arange(3)
    return np.asarray(1.0 / np.einsum("ni,ij,nj->n", powers, inverse, powers))


def _roots(coefficients: Floats) -> tuple[Floats, Floats]:
    """The lesser and the greater real root of `c0 + c1 y + c2 y^2`, float64 [n] each, from float64 [n, 3]."""
    c, b, a = coefficients.T
    half = -0.5 * (b + np.copysign(np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0)), b))
    with np.errstate(divide="ignore"):
        first, second = np.clip(half / a, -_FAR, _FAR), np.clip(c / half, -_FAR, _FAR)
    return np.minimum(first, second), np.maximum(first, second)
