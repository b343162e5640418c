"""Twin of `weighted-blended`."""

from __future__ import annotations

import numpy as np

from renderer.reference.pixels import Floats, Pixel, picture_of
from schemas.fragments import FragmentDump


def weights(depth: Floats, alpha: Floats, near: float, far: float, equation: int = 10) -> Floats:
    """The weights w of McGuire and Bavoil 2013, float64 [n].

    Args:
        depth: float64 [n], metres.
        alpha: float64 [n].
        near: Near plane, metres.
        far: Far plane, metres.
        equation: Its number in the paper, 7..10.
    """
    if equation == 10:
        d = np.clip(np.log(depth / near) / np.log(far / near), 0.0, 1.0)
        return np.asarray(alpha * np.maximum(1e-2, 3e3 * (1.0 - d) ** 3))
    z = 500.0 * depth / far
    curves = {
        7: 10.0 / (1e-5 + (z / 5.0) ** 2 + (z / 200.0) ** 6),
        8: 10.0 / (1e-5 + (z / 10.0) ** 3 + (z / 200.0) ** 6),
        9: 0.03 / (1e-5 + (z / 200.0) ** 4),
    }
    return np.asarray(alpha * np.clip(curves[equation], 1e-2, 3e3))


def picture(dump: FragmentDump, near: float, far: float, equation: int = 10) -> Floats:
    """The picture, float64 [P, 3], linear RGB.

    Args:
        dump: Fragments of a view.
        near: Near plane, metres.
        far: Far plane, metres.
        equation: 7..10.
    """

    def colour(pixel: Pixel) -> Floats:
        w = weights(pixel.depth.astype(np.float64), pixel.alpha, near, far, equation)
        return pixel.mean(w * pixel.alpha, float(np.prod(1.0 - pixel.alpha)))

    return picture_of(dump, colour)
