"""Twin of `wavelet`: means of the cells directly, which are what a Haar basis of that rank holds."""

from __future__ import annotations

import numpy as np

from renderer.reference.pixels import Floats, Pixel, picture_of
from schemas.fragments import FragmentDump

CELLS = 16


def in_front(absorbance: Floats, place: Floats) -> Floats:
    """The absorbance in front of each fragment, float64 [n].

    Args:
        absorbance: float64 [n], > 0.
        place: float64 [n] in 0..15, depths in cells.
    """
    ends = np.arange(1, CELLS + 1)
    steps = absorbance[:, None] * np.clip(ends - place[:, None], 0.0, 1.0)  # [n, cells]: means of each one's step
    means = np.concatenate([[0.0], steps.sum(axis=0)])
    cell = place.astype(int)
    t = place - cell
    own = means[cell + 1] - steps[np.arange(len(cell)), cell]
    return np.asarray((1.0 - t) * means[cell] + t * own)


def picture(dump: FragmentDump) -> Floats:
    """The picture, float64 [P, 3], linear RGB.

    Args:
        dump: Fragments of a view.
    """

    def colour(pixel: Pixel) -> Floats:
        absorbance = -np.log1p(-pixel.alpha)
        depth = pixel.depth.astype(np.float64)
        extent = depth.max() - depth.min()
        place = (CELLS - 1) * (depth - depth.min()) / extent if extent > 0.0 else np.zeros(len(depth))
        weights = pixel.alpha * np.exp(-in_front(absorbance, place))
        return pixel.mean(weights, float(np.prod(1.0 - pixel.alpha)))

    return picture_of(dump, colour)
