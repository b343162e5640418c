"""Exponentials and display values of whole arrays, without a branch or a table, so that they compile to SIMD code.

Both are polynomials (Chebyshev interpolation, degree 10) of what the functions become smooth in; the tests compare
them with the functions themselves. No fused multiply-add: the results do not depend on the processor.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from schemas.tail import MAX_EXPONENT

_LINEAR_PART: Final = 0.0031308  # sRGB: below, the display value is 12.92 times the linear one

_DISPLAY: Final = (
    0.3372516866316993,
    0.4518347023842591,
    0.18216393156970176,
    0.02797795021609413,
    0.0008056949311624394,
    -3.7123956962757935e-05,
    3.5637658548862604e-06,
    -4.674206125111916e-07,
    7.383242081046808e-08,
    -1.4963481392986042e-08,
    3.010433248868908e-09,
)
"""`1.055 q^(10/3) - .055` with q the eighth root of linear light, from that of `_LINEAR_PART` to 1: 7e-13 off."""

_EXPONENTIAL: Final = (
    0.6257840096045911,
    -0.29333625450219114,
    0.06875068464895309,
    -0.010742294475599703,
    0.001258862633861692,
    -0.00011801837643269649,
    9.22018562663465e-06,
    -6.174127953982775e-07,
    3.6176584427096564e-08,
    -1.8945777428901953e-09,
    8.878267204202573e-11,
)
"""`exp(-x / 64)` for x from 0 to 60; its 64th power is 7e-13 off, relatively."""

_LEAST_ROOT: Final = _LINEAR_PART**0.125
_ROOT_SCALE: Final = 2.0 / (1.0 - _LEAST_ROOT)
_ROOT_SHIFT: Final = -1.0 - _LEAST_ROOT * _ROOT_SCALE
_EXPONENT_SCALE: Final = 2.0 / MAX_EXPONENT


@njit(inline="always")
def _polynomial(c: tuple[float, ...], u: float) -> float:
    y = ((c[10] * u + c[9]) * u + c[8]) * u + c[7]
    y = (((y * u + c[6]) * u + c[5]) * u + c[4]) * u + c[3]
    return ((y * u + c[2]) * u + c[1]) * u + c[0]


@njit(cache=True, error_model="numpy")
def tail_weights(alpha: NDArray[np.float64], exponent: NDArray[np.float64], g: float, out: NDArray[np.float64]) -> None:
    """`alpha exp(-min(g x, MAX_EXPONENT))`, METHOD section 2.

    Args:
        alpha: float64 [M].
        exponent: float64 [M], x = D (z - z_min) / (z_max - z_min), >= 0.
        g: Steepness, >= 0.
        out: float64 [M].
    """
    for i in range(len(out)):
        x = g * exponent[i]
        x = x if x < MAX_EXPONENT else MAX_EXPONENT
        y = _polynomial(_EXPONENTIAL, x * _EXPONENT_SCALE - 1.0)
        y = y * y * y * y
        y = y * y * y * y
        out[i] = alpha[i] * (y * y * y * y)


@njit(inline="always")
def display_of(linear: float) -> float:
    """Linear light to the sRGB display value (IEC 61966-2-1), clamped to [0, 1]."""
    x = linear if linear > 0.0 else 0.0
    x = x if x < 1.0 else 1.0
    y = _polynomial(_DISPLAY, math.sqrt(math.sqrt(math.sqrt(x))) * _ROOT_SCALE + _ROOT_SHIFT)
    return 12.92 * x if x <= _LINEAR_PART else y


@njit(cache=True, error_model="numpy")
def add_squared(
    base: NDArray[np.float64],
    factor: NDArray[np.float64],
    sums: NDArray[np.float64],
    exact: NDArray[np.float64],
    display: bool,
    out: NDArray[np.float64],
) -> None:
    """Add the squared differences of `base + factor sums`, as display values if `display`, from `exact`: all [M].

    Args:
        base: float64 [M], one channel of the core and of the background behind core and tail.
        factor: float64 [M], the tail's share of the pixel, over the sum of its weights.
        sums: float64 [M], the same channel of the tail's fragments, weighted and summed.
        exact: float64 [M], the exact values: sRGB-encoded if `display`, else linear.
        display: Whether to compare display values (sRGB, clamped) rather than linear ones.
        out: float64 [M], squared differences, added to in place.
    """
    if display:
        for i in range(len(out)):
            difference = display_of(base[i] + factor[i] * sums[i]) - exact[i]
            out[i] += difference * difference
    else:
        for i in range(len(out)):
            difference = base[i] + factor[i] * sums[i] - exact[i]
            out[i] += difference * difference
