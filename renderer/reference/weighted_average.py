"""Twin of `weighted-average`."""

from __future__ import annotations

from renderer.reference.pixels import Floats, Pixel, picture_of
from schemas.fragments import FragmentDump


def picture(dump: FragmentDump) -> Floats:
    """The picture, float64 [P, 3], linear RGB."""
    return picture_of(dump, _colour)


def _colour(pixel: Pixel) -> Floats:
    return pixel.mean(pixel.alpha, float((1.0 - pixel.alpha.mean()) ** len(pixel.alpha)))
