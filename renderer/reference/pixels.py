"""One pixel's fragments as the twins read them, and the mean that several techniques resolve to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pixel:
    """The fragments of a pixel, n > 0, decoded.

    Attributes:
        index: p.
        colour: float64 [n, 3], linear RGB.
        alpha: float64 [n].
        depth: float32 [n], metres.
        behind: float64 [3], linear RGB of the background.
    """

    index: int
    colour: Floats
    alpha: Floats
    depth: NDArray[np.float32]
    behind: Floats

    def mean(self, weights: Floats, through: float) -> Floats:
        """`(1 - T) sum w C / sum w + T C_bg`, float64 [3].

        Args:
            weights: float64 [n], not all zero.
            through: T, total transmittance.
        """
        colour: Floats = (1.0 - through) * (weights @ self.colour) / weights.sum() + through * self.behind
        return colour


def picture_of(dump: FragmentDump, colour_of: Callable[[Pixel], Floats]) -> Floats:
    """Every pixel's colour, float64 [P, 3], linear RGB; the background where there is no fragment.

    Args:
        dump: Fragments of a view.
        colour_of: Gives a pixel's colour, float64 [3].
    """
    made = decode_gamma2(dump.background)
    for p in np.flatnonzero(dump.counts):
        run = slice(dump.offsets[p], dump.offsets[p + 1])
        rgba = dump.rgba[run]
        pixel = Pixel(
            index=int(p),
            colour=decode_gamma2(rgba[:, :3]),
            alpha=rgba[:, 3] / 255.0,
            depth=dump.depth[run],
            behind=made[p],
        )
        made[p] = colour_of(pixel)
    return made
