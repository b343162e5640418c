"""`weighted-average`: all fragments as n surfaces of their mean colour and mean opacity (Bavoil and Myers 2008)."""

from __future__ import annotations

from renderer.frame import Clock, Frame
from renderer.screen import resolve_screen
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.sums import rendered

_PIXEL_BYTES = 16 + 4
"""Sums of colour and alpha, count."""


class WeightedAverage(Technique):
    """One additive pass.

    `C = (1 - T) sum a_i C_i / sum a_i + T C_bg` with `T = (1 - sum a_i / n)^n`: Meshkin's order-independent sum (Sort-
    Independent Alpha Blending, GDC 2007) normalised as Bavoil and Myers do (Order Independent Transparency with Dual
    Depth Peeling, NVIDIA 2008, section "Weighted Average"). It is the tail `weighted-average` of METHOD.md with k = 0:
    exact for one fragment, and for fragments of one colour and one opacity; the total transmittance is too large where
    opacities differ.
    """

    name = "weighted-average"
    family = "approximate"
    about = "mean colour, mean opacity"
    twin = Twin("weighted_average")

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the sums take the same memory whatever n is."""
        clock = Clock(frame.ctx)
        with clock.measure("sums"):
            targets = frame.float_targets(4, 1)
            frame.draw_transparent("weighted-average/sums.frag", frame.target(targets))
        with clock.measure("resolve"):
            image = resolve_screen(frame, "weighted-average/resolve.frag", [frame.background, *targets])
        return rendered(frame, image, frame.passes("opaque"), clock, _PIXEL_BYTES)
