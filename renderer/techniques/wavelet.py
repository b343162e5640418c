"""`wavelet`: transmittance from 16 Haar coefficients of the absorbance in a pixel (Aizenshtein et al. 2022)."""

from __future__ import annotations

from renderer.frame import Clock, Frame
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.sums import draw_in_range, rendered, resolve_mean
from schemas.tail import MAX_EXPONENT

_PIXEL_BYTES = 12 + 4 + 64 + 16
"""Counts and depth range, absorbance, coefficients, sums of weighted colour and weight."""

_DEFINES = {"MAX_EXPONENT": MAX_EXPONENT}


class Wavelet(Technique):
    """Two additive passes (Wavelet Transparency, arXiv 2201.00094), after the count pass.

    1. The absorbance in front of a depth, `A(z) = sum of -ln(1-a_i) over z_i < z`, on a Haar basis of rank 3: a
       constant and the 15 wavelets of the levels 0 to 3. A fragment is a step, which adds to five of the 16.
    2. From the coefficients the mean of A in each sixteenth of the depth range. In front of a fragment it is taken
       between the mean of its own cell, less what the fragment itself adds to it, and that of the cell in front of it,
       by the fragment's place in its cell. Colours are summed with the weights `a exp(-A)`.

    The result is `(1 - T) sum a exp(-A) C / sum a exp(-A) + T C_bg` with the exact total transmittance T. This is how
    the engines evaluate it that have it (Flywheel, `internal/oit/wavelet.glsl`, in Minecraft's Create): depths lie
    linearly between the nearest and the farthest fragment of a pixel and end at 15/16, so that the last cell's mean
    knows every step.

    What differs from them: coefficients and sums are float32 instead of half floats, so that errors are those of the
    basis; 64 bytes per pixel of coefficients, which half floats halve. T is kept in a sum of its own and not read from
    the coefficients.
    """

    name = "wavelet"
    family = "approximate"
    about = "transmittance from 16 Haar coefficients (Aizenshtein)"
    twin = Twin("wavelet")

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the coefficients take the same memory whatever n is."""
        frame.depth_range()
        clock = Clock(frame.ctx)
        with clock.measure("coefficients"):
            totals, *parts = frame.float_targets(1, 4, 4, 4, 4)
            draw_in_range(frame, "wavelet/coefficients.frag", [totals, *parts], _DEFINES)
        with clock.measure("blend"):
            (colours,) = frame.float_targets(4)
            for unit, texture in enumerate(parts):
                texture.use(unit)
            draw_in_range(frame, "wavelet/blend.frag", [colours], _DEFINES)
        with clock.measure("resolve"):
            image = resolve_mean(frame, colours, totals)
        return rendered(frame, image, frame.passes("opaque", "count"), clock, _PIXEL_BYTES)
