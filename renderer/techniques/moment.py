"""`moment`: transmittance from four power moments of the absorbance in a pixel (Muenstermann et al. 2018)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from renderer.frame import Clock, Frame
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.sums import draw_in_range, rendered, resolve_mean
from schemas.problem import Problem
from schemas.tail import MAX_EXPONENT

BIAS = 5e-7
"""How far moments are moved towards those of a spread distribution: the paper's value for float32 moments."""

OVERESTIMATION = 0.25
"""Share of the mass at a fragment's own depth that counts as in front of it: the paper's value."""

_PIXEL_BYTES = 12 + 20 + 16
"""Counts and depth range, moments, sums of weighted colour and weight."""


class Moment(Technique):
    """Two additive passes (Moment-Based Order-Independent Transparency, PACMCGIT 1(1), 2018), after the count pass.

    1. `b_0 = sum -ln(1-a_i)` and `b_j = sum -ln(1-a_i) x_i^j`, j = 1..4, of the warped depths x in [-1, 1].
    2. From `b_j / b_0`, moved by `bias` towards the moments (0, .375, 0, .375), the share F(x) of the absorbance in
       front of x; the transmittance there is `T(x) = exp(-b_0 F(x))`. Colours are summed with the weights a T(x).

    The result is `(1 - exp(-b_0)) sum a T C / sum a T + exp(-b_0) C_bg`: the total transmittance is exact.

    F is a solution of the truncated Hamburger moment problem: among the distributions with these moments, the one that
    has a point at x (Peters and Klein, Moment Shadow Mapping, 2015). With the orthogonal polynomials `P_1 = y` and
    `P_2 = y^2 - s y - h_1` of y = x - mean, their squared norms h_1 and h_2, and the kernel
    `K(t, y) = 1 + t y / h_1 + P_2(t) P_2(y) / h_2`, that distribution has its points at t = x - mean and at the two
    roots y of `K(t, y) = 0`. The mass at t is `1 / K(t, t)`; those at the roots follow from the moments 0 and 1. F is
    the mass in front of x and `overestimation` times the mass at x itself. This solves the paper's system of equations,
    but nothing in it divides by the distance of roots that may coincide, and h_1 and h_2 have lower bounds from the
    bias alone: F stays in 0..1 whatever is rounded.

    Float32 pictures differ from float64 ones by less than 1e-5 in linear light, but for up to about 1e-3 in less than
    one pixel of a thousand, where two or three tight groups of fragments are far apart: the moments' rounding is as
    large there as what tells the fragments of a group apart. Pixels of three fragments of which two are close are such;
    the worst of 170,000 was 1.4e-2.

    What differs from the paper: depths are warped logarithmically, as there, but between the nearest and the farthest
    fragment of the pixel instead of the camera's planes. Moments of an affine image of x tell the same, so without bias
    and rounding nothing would change; with them, a pixel whose fragments are close together for the scene keeps its
    digits. It costs the count pass and 12 bytes per pixel, and has about .7 times the squared error. Where b_0 is
    large, T is taken relative to the nearest depth: the factor cancels, and weights do not vanish.

    Args:
        bias: Of the moments, above 0.
        overestimation: 0 underestimates what is in front, 1 overestimates it.

    Raises:
        Problem: A constant is out of range.
    """

    name = "moment"
    family = "approximate"
    about = "transmittance from 4 power moments (Muenstermann)"
    twin = Twin("moment")

    def __init__(self, bias: float = BIAS, overestimation: float = OVERESTIMATION) -> None:
        if not (1e-12 <= bias < 1.0 and 0.0 <= overestimation <= 1.0):
            raise Problem(
                f"moment cannot work with a bias of {bias} and an overestimation of {overestimation}.",
                "Give a bias of at least 1e-12 and below 1, and an overestimation of 0 to 1.",
            )
        self._defines = {
            "MOMENT_BIAS": float(bias),
            "OVERESTIMATION": float(overestimation),
            "MAX_EXPONENT": MAX_EXPONENT,
        }

    def parameters(self, frame: Frame) -> Mapping[str, Any]:
        """See `Technique.parameters`."""
        return {"bias": self._defines["MOMENT_BIAS"], "overestimation": self._defines["OVERESTIMATION"]}

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the moments take the same memory whatever n is."""
        frame.depth_range()
        clock = Clock(frame.ctx)
        with clock.measure("moments"):
            totals, moments = frame.float_targets(1, 4)
            draw_in_range(frame, "moment/moments.frag", [totals, moments], self._defines)
        with clock.measure("blend"):
            (colours,) = frame.float_targets(4)
            for unit, texture in enumerate((totals, moments)):
                texture.use(unit)
            draw_in_range(frame, "moment/blend.frag", [colours], self._defines)
        with clock.measure("resolve"):
            image = resolve_mean(frame, colours, totals)
        return rendered(frame, image, frame.passes("opaque", "count"), clock, _PIXEL_BYTES)
