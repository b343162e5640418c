"""`weighted-blended`: a mean weighted by a fixed function of depth (McGuire and Bavoil 2013)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from renderer.frame import Clock, Frame
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.sums import rendered, resolve_mean

Equation = Literal[7, 8, 9, 10]
"""A weight of the paper, by the number of its equation."""

FAR_Z = 500.0
"""The |z| for whose range, 0.1 to 500, equations 7 to 9 are tuned."""

_PIXEL_BYTES = 16 + 4
"""Sums of weighted colour and weight, optical depth."""


class WeightedBlended(Technique):
    """One additive pass (Weighted Blended Order-Independent Transparency, JCGT 2(2), equation 6).

    `C = (1 - T) sum w_i a_i C_i / sum w_i a_i + T C_bg` with the exact `T = prod (1-a_i)`, taken as
    `exp(-sum -ln(1-a_i))` so that both targets blend additively. The weights, with the paper's constants:

    - 7: `w = a clamp(10 / (1e-5 + (|z|/5)^2 + (|z|/200)^6), 1e-2, 3e3)`
    - 8: `w = a clamp(10 / (1e-5 + (|z|/10)^3 + (|z|/200)^6), 1e-2, 3e3)`
    - 9: `w = a clamp(0.03 / (1e-5 + (|z|/200)^4), 1e-2, 3e3)`
    - 10: `w = a max(1e-2, 3e3 (1 - d)^3)`

    What differs from the paper is where z comes from, since scenes come in every unit: no scene may need other
    constants. In 7 to 9, tuned for |z| up to 500, `|z| = 500 depth / far` with the far plane of the view, which lies
    tight around the scene. In 10, d is window depth in the paper; that is nearly 1 everywhere if the near plane is
    close to the eye, and all weights are alike. Here `d = ln(depth / near) / ln(far / near)`: the same ends, and equal
    ratios of depth count the same, so that d depends neither on units nor much on where the near plane is. With it, 10
    has about half the squared error of 7 to 9 and a third of that of 10 with window depth (geometric mean over views
    of five scenes at alpha .33), so it is the default. Targets are float32, so weights need no other bounds.

    Args:
        equation: Which weight.
    """

    name = "weighted-blended"
    family = "approximate"
    about = "mean weighted by depth (McGuire)"
    twin = Twin("weighted_blended")

    def __init__(self, equation: Equation = 10) -> None:
        self._equation = equation

    def parameters(self, frame: Frame) -> Mapping[str, Any]:
        """See `Technique.parameters`."""
        near, far = frame.view.clip_range(frame.gpu.scene.bounds)
        return {"near": near, "far": far, "equation": self._equation}

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the sums take the same memory whatever n is."""
        near, far = frame.view.clip_range(frame.gpu.scene.bounds)
        clock = Clock(frame.ctx)
        with clock.measure("sums"):
            colours, depths = frame.float_targets(4, 1)
            frame.draw_transparent(
                "weighted-blended/sums.frag",
                frame.target([colours, depths]),
                {"EQUATION": self._equation},
                near_depth=near,
                far_depth=far,
                far_z=FAR_Z,
            )
        with clock.measure("resolve"):
            image = resolve_mean(frame, colours, depths)
        return rendered(frame, image, frame.passes("opaque"), clock, _PIXEL_BYTES)
