"""The one quantisation rule for colour that renderer, labeller and exporter share.

Colours are stored in 8 bits as the square root of linear RGB ("gamma 2"): near-black keeps steps of 1.5e-5
where linear 8 bits would have 4e-3, and decoding is one multiplication, in a shader as on the CPU.
Alpha is stored linearly. Display colours are sRGB (IEC 61966-2-1).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def encode_gamma2(linear: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Linear RGB in [0,1] (clamped) to stored 8-bit values, any shape.

    Args:
        linear: Linear RGB of any shape, any floating dtype.
    """
    root = np.sqrt(np.clip(linear, 0.0, 1.0))
    stored: NDArray[np.uint8] = np.floor(root * 255.0 + 0.5).astype(np.uint8)
    return stored


def decode_gamma2(stored: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Stored 8-bit values to linear RGB in [0,1], float64, any shape.

    Args:
        stored: Stored values of any shape, uint8, gamma-2 encoded.
    """
    root = stored.astype(np.float64) / 255.0
    return root * root


def linear_to_srgb(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """Linear RGB to sRGB-encoded display values, both in [0,1] (clamped), float64 (IEC 61966-2-1).

    Args:
        linear: Linear RGB (Rec. 709 primaries) of any shape.
    """
    c = np.clip(np.asarray(linear, dtype=np.float64), 0.0, 1.0)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.power(c, 1.0 / 2.4) - 0.055)


def srgb_to_linear(display: NDArray[np.floating]) -> NDArray[np.float64]:
    """sRGB-encoded values in [0,1] to linear RGB, float64 (IEC 61966-2-1).

    Args:
        display: sRGB-encoded values of any shape; clamped to [0,1].
    """
    c = np.clip(np.asarray(display, dtype=np.float64), 0.0, 1.0)
    return np.where(c <= 0.04045, c / 12.92, np.power((c + 0.055) / 1.055, 2.4))


def display8(linear: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Linear RGB to the 8-bit sRGB values that a screen or a PNG gets, any shape.

    Args:
        linear: Linear RGB of any shape; clamped to [0,1].
    """
    return np.floor(linear_to_srgb(linear) * 255.0 + 0.5).astype(np.uint8)
