"""LDR-FLIP in plain numpy, as the paper has it: where the library is not installed, and what tests compare it with.

Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images"; sections in brackets below.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schemas.colour import srgb_to_linear

Map = NDArray[np.float32]

PIXELS_PER_DEGREE = 67.02
"""FLIP's default viewer: 0.7 m from a screen of 0.7 m and 3840 pixels."""

_XYZ = np.array(
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
"""Linear Rec. 709 to CIE XYZ, white D65."""
_WHITE = _XYZ.sum(axis=1)

_CONTRAST = (((1.0, 0.0047),), ((1.0, 0.0053),), ((34.1, 0.04), (13.5, 0.025)))
"""Amplitudes and exponents of the Gaussians of the contrast sensitivity of Y, Cx and Cz [4.1.1, table 1]."""
_WIDEST = 0.04
_COLOUR_POWER, _KNEE, _KNEE_ERROR = 0.7, 0.4, 0.95
"""q_c, p_c and p_t of the colour difference [4.1.2]."""
_FEATURE_DEGREES, _FEATURE_POWER = 0.082, 0.5
"""w and q_f of the feature difference [4.2]."""


def flip(test: NDArray[np.uint8], reference: NDArray[np.uint8], pixels_per_degree: float = PIXELS_PER_DEGREE) -> Map:
    """Error map, float32 [H, W] in [0,1].

    Args:
        test: uint8 [H, W, 3], sRGB.
        reference: The same shape.
        pixels_per_degree: Of the viewer.
    """
    opponents = [_opponent(image) for image in (reference, test)]
    colour = _colour_difference(*(_perceived(image, pixels_per_degree) for image in opponents))
    features = [_features((image[0] + 16.0) / 116.0, pixels_per_degree) for image in opponents]
    edge, point = (np.abs(a - b) for a, b in zip(*features, strict=True))
    feature = (np.maximum(edge, point) / math.sqrt(2.0)) ** _FEATURE_POWER
    return np.asarray(colour ** (1.0 - np.minimum(feature, 1.0)), dtype=np.float32)


def _opponent(image: NDArray[np.uint8]) -> Map:
    """YCxCz, float32 [3, H, W] [4.1.1]."""
    table = srgb_to_linear(np.arange(256) / 255.0).astype(np.float32)
    x, y, z = np.tensordot(_XYZ / _WHITE[:, None], table[image], axes=([1], [2])).astype(np.float32)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


def _perceived(opponent: Map, pixels_per_degree: float) -> Map:
    """What is seen from afar, in CIELAB with Hunt's effect, float32 [3, H, W] [4.1.1, 4.1.2]."""
    radius = math.ceil(3.0 * math.sqrt(_WIDEST / (2.0 * math.pi**2)) * pixels_per_degree)
    at = np.arange(-radius, radius + 1) / pixels_per_degree
    filtered = []
    for channel, gaussians in zip(opponent, _CONTRAST, strict=True):
        taps = [np.exp(-(math.pi**2) * at**2 / b) for _, b in gaussians]
        shares = np.array([a * math.sqrt(math.pi / b) for a, b in gaussians])
        shares /= sum(share * tap.sum() ** 2 for share, tap in zip(shares, taps, strict=True))
        smoothed = [share * _filter(channel, tap, tap) for share, tap in zip(shares, taps, strict=True)]
        filtered.append(np.sum(smoothed, axis=0))
    y, x, z = filtered
    relative = (y + 16.0) / 116.0
    xyz = np.stack([relative + x / 500.0, relative, relative - z / 200.0])
    linear = np.tensordot(np.linalg.inv(_XYZ) * _WHITE, xyz, axes=1)
    return _hunt_lab(np.clip(linear, 0.0, 1.0))


def _hunt_lab(linear: NDArray[np.floating]) -> Map:
    """CIELAB of linear RGB [3, ...], chroma scaled by lightness (Hunt)."""
    x, y, z = np.tensordot(_XYZ / _WHITE[:, None], linear, axes=1)
    fx, fy, fz = (_lab_root(value) for value in (x, y, z))
    lightness = 116.0 * fy - 16.0
    return np.stack([lightness, 0.01 * lightness * 500.0 * (fx - fy), 0.01 * lightness * 200.0 * (fy - fz)]).astype(
        np.float32
    )


def _lab_root(value: NDArray[np.floating]) -> NDArray[np.floating]:
    knee = 6.0 / 29.0
    return np.where(value > knee**3, np.cbrt(value), value / (3.0 * knee**2) + 4.0 / 29.0)


def _colour_difference(a: Map, b: Map) -> Map:
    """HyAB distances, compressed so that differences beyond the usual stay apart [4.1.2]."""
    furthest = _hyab(*(_hunt_lab(np.array(colour)) for colour in ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0))))
    most = float(furthest) ** _COLOUR_POWER
    power = _hyab(a, b) ** _COLOUR_POWER
    knee = _KNEE * most
    above = _KNEE_ERROR + (power - knee) / (most - knee) * (1.0 - _KNEE_ERROR)
    compressed = np.where(power < knee, _KNEE_ERROR / knee * power, np.minimum(above, 1.0))
    return np.asarray(compressed, dtype=np.float32)


def _hyab(a: Map, b: Map) -> Map:
    return np.asarray(np.abs(a[0] - b[0]) + np.hypot(a[1] - b[1], a[2] - b[2]))


def _features(luminance: Map, pixels_per_degree: float) -> tuple[Map, Map]:
    """Strength of edges and of points, float32 [H, W] each [4.2]."""
    deviation = 0.5 * _FEATURE_DEGREES * pixels_per_degree
    radius = math.ceil(3.0 * deviation)
    at = np.arange(-radius, radius + 1, dtype=np.float64)
    smooth = np.exp(-(at**2) / (2.0 * deviation**2))
    found = []
    for taps in (-at * smooth, (at**2 / deviation**2 - 1.0) * smooth):
        # Positive weights of the two-dimensional filter sum to 1, and negative ones to -1.
        sums = smooth.sum() * np.array([taps[taps > 0.0].sum(), -taps[taps < 0.0].sum()])
        scaled = np.where(taps > 0.0, taps / sums[0], taps / sums[1])
        found.append(np.hypot(_filter(luminance, scaled, smooth), _filter(luminance, smooth, scaled)))
    return found[0], found[1]


def _filter(values: Map, across: NDArray[np.float64], down: NDArray[np.float64]) -> Map:
    """A separable filter, borders repeated: float32 [H, W]."""
    return _along(_along(values, across).T, down).T


def _along(values: Map, taps: NDArray[np.float64]) -> Map:
    """A filter along the rows."""
    radius = len(taps) // 2
    padded = np.pad(values, ((0, 0), (radius, radius)), mode="edge")
    out, scratch = np.zeros_like(values), np.empty_like(values)
    for i, tap in enumerate(taps.astype(np.float32)):
        np.multiply(padded[:, i : i + values.shape[1]], tap, out=scratch)
        out += scratch
    return out
