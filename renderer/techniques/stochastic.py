"""`stochastic`: visibility from a few depth samples a pixel, chosen at random (Enderton et al. 2010)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from renderer.frame import Clock, Frame
from renderer.techniques.base import Budget, Needs, Rendered, Technique, Twin
from renderer.techniques.sums import rendered, resolve_mean
from schemas.limits import LIMITS
from schemas.problem import Problem

SAMPLES = 8
"""Default samples a pixel."""

MAX_SAMPLES = 32
"""Samples a pixel at most: a fragment's coverage is one word."""

_PIXEL_BYTES = 16 + 4
"""Sums of weighted colour and weight, optical depth."""

_EMPTY = b"\xff\xff\xff\xff"
"""A depth behind all others."""


class Stochastic(Technique):
    """Depth-based stochastic transparency with alpha correction (Stochastic Transparency, I3D 2010, section 3).

    1. Every fragment covers `floor(a S + xi)` of its pixel's S samples, a random subset (stratified sampling of alpha);
       a sample keeps the nearest depth that covers it.
    2. A fragment's visibility V is the share of samples that have nothing nearer: on average
       `prod_{j nearer} (1-a_j)`, as of a stochastic shadow map. Colours are summed with the weights a V.

    The result is `(1 - T) sum a V C / sum a V + T C_bg`, T the exact total transmittance (alpha correction): noise is
    in the mixture of colours only, never in coverage.

    What differs from the paper: samples are words that `atomicMin` lowers, not those of a multisampled depth buffer, so
    S is free and all samples are at the pixel's centre (no anti-aliasing). The random numbers are a hash of the pixel,
    the fragment's depth and stored colour, and the seed: the picture is the same from run to run and in any order of
    drawing. Fragments of equal depth do not hide each other, as with the paper's depth test.

    Samples of large pictures are drawn in bands of rows that fit a storage buffer.

    Args:
        samples: S, 1..32.
        seed: 0..2^32-1; another one gives other noise.

    Raises:
        Problem: `samples` is out of range.
    """

    name = "stochastic"
    family = "approximate"
    about = "visibility from random depth samples (Enderton)"
    twin = Twin("stochastic")

    def __init__(self, samples: int = SAMPLES, seed: int = 0) -> None:
        if not 1 <= samples <= MAX_SAMPLES:
            raise Problem(
                f"stochastic cannot work with {samples} samples a pixel.", f"Ask for 1 up to {MAX_SAMPLES} samples."
            )
        self._samples, self._seed = samples, seed

    @classmethod
    def of(cls, needs: Needs) -> Self:
        """See `Technique.of`."""
        return cls() if needs.samples is None else cls(needs.samples)

    def parameters(self, frame: Frame) -> Mapping[str, Any]:
        """See `Technique.parameters`."""
        return {"samples": self._samples, "seed": self._seed}

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the samples take the same memory whatever n is."""
        row_bytes = 4 * self._samples * frame.width
        rows = min(frame.height, LIMITS.buffer_bytes // row_bytes)
        samples = frame.ctx.buffer(reserve=rows * row_bytes)
        samples.bind_to_storage_buffer(0)
        defines = {"SAMPLES": self._samples}
        clock = Clock(frame.ctx)
        with clock.measure("samples"):
            colours, depths = frame.float_targets(4, 1)
        for first in range(0, frame.height, rows):
            band = first, min(rows, frame.height - first)
            with clock.measure("samples"):
                samples.clear(chunk=_EMPTY)
                frame.draw_transparent(
                    "stochastic/samples.frag", frame.target([]), defines, band, first_row=first, seed=self._seed
                )
                frame.ctx.memory_barrier()
            with clock.measure("blend"):
                frame.draw_transparent(
                    "stochastic/blend.frag", frame.target([colours, depths]), defines, band, first_row=first
                )
        with clock.measure("resolve"):
            image = resolve_mean(frame, colours, depths)
        return rendered(frame, image, frame.passes("opaque"), clock, _PIXEL_BYTES, pool_bytes=rows * row_bytes)
