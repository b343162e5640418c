"""The polynomials of the SIMD code against the functions that they stand for, and where their numbers are from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from labeller import numerics
from schemas.colour import linear_to_srgb
from schemas.tail import MAX_EXPONENT

LEAST_ROOT = 0.0031308**0.125


def fitted(function: Callable[[NDArray[np.float64]], NDArray[np.float64]], first: float, last: float) -> list[float]:
    """Powers of u in [-1, 1] of the least-squares polynomial of degree 10 on 400 Chebyshev nodes."""
    u = np.cos(np.pi * (np.arange(400) + 0.5) / 400)
    values = function((u + 1.0) / 2.0 * (last - first) + first)
    return list(chebyshev.cheb2poly(chebyshev.chebfit(u, values, 10)))


def test_the_coefficients_are_those_of_the_fits() -> None:
    display = fitted(lambda q: 1.055 * q ** (10 / 3) - 0.055, LEAST_ROOT, 1.0)
    exponential = fitted(lambda x: np.exp(-x), 0.0, MAX_EXPONENT / 64)
    # A processor's own linear algebra rounds the fit its own way: 1.3e-14 were seen.
    np.testing.assert_allclose(numerics._DISPLAY, display, rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(numerics._EXPONENTIAL, exponential, rtol=0.0, atol=1e-13)


def test_display_values_are_those_of_the_standard() -> None:
    x = np.concatenate([[-1.0, 0.0, 1e-30, 0.0031308, 0.00313081, 1.0, 1.0 + 1e-15, 2.0], np.linspace(0, 1, 100_001)])
    found = np.array([numerics.display_of(value) for value in x])
    np.testing.assert_allclose(found, linear_to_srgb(np.clip(x, 0.0, 1.0)), rtol=0.0, atol=2e-12)
    # The standard's own two pieces do not meet exactly: 3e-8 apart at .0031308.
    rising = np.linspace(0.0031309, 1.0, 100_001)
    assert (np.diff([numerics.display_of(value) for value in rising]) > 0.0).all()


@pytest.mark.parametrize("display", [True, False])
def test_squared_differences_add_up(display: bool) -> None:
    base, factor, sums, exact, before = np.random.default_rng(0).random((5, 1000))
    colour = base + factor * sums
    found = before.copy()
    numerics.add_squared(base, factor, sums, exact, display, found)
    shown = linear_to_srgb(np.clip(colour, 0.0, 1.0)) if display else colour
    np.testing.assert_allclose(found, before + (shown - exact) ** 2, rtol=1e-11)


@pytest.mark.parametrize("g", [0.25, 0.75, 3.0])
def test_tail_weights_are_exponentials_with_a_clamp(g: float) -> None:
    exponent = np.concatenate([np.linspace(0.0, 60.0, 10_001), [1e3, 1e30, np.inf]])
    alpha, found = np.full(len(exponent), 0.4), np.empty(len(exponent))
    numerics.tail_weights(alpha, exponent, g, found)
    np.testing.assert_allclose(found, 0.4 * np.exp(-np.minimum(g * exponent, MAX_EXPONENT)), rtol=1e-12)
    assert (found > 0.0).all()
