"""Where the samples of an antialiased picture are: cameras that are moved by less than a pixel.

Every sample is a frame of its own, of the picture's size, so that a technique does at every sample what it does at a
pixel's centre: its budget, its tiles and the features that a network reads are those of a frame. The mean of the
frames, in linear light, is the picture: a box filter of one pixel.

The positions are a (0, 2)-sequence in base 2, Hammersley's points (Niederreiter 1992): of S samples each of S rows and
each of S columns of a pixel has one, and their mean is the pixel's centre.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from schemas.view import View

SAMPLES: Final = (1, 2, 4, 8, 16, 32, 64)
"""How many samples a pixel can have."""


def positions(samples: int) -> NDArray[np.float64]:
    """Where samples lie from their pixel's centre, float64 [S, 2], pixels to the right and upwards, within half of one.

    Args:
        samples: S, one of SAMPLES.
    """
    bits = samples.bit_length() - 1
    order = np.arange(samples)
    turned = sum(((order >> bit) & 1) << (bits - 1 - bit) for bit in range(bits)) + np.zeros(samples, dtype=np.int64)
    return (np.stack([order, turned], axis=1) + 0.5) / samples - 0.5


def sample_views(view: View, height: int, samples: int) -> list[View]:
    """A camera at each sample of its pixels; with one sample, the camera itself.

    Args:
        view: The camera.
        height: Rows of the picture.
        samples: S, one of SAMPLES.
    """
    if samples == 1:
        return [view]
    right, up = view.shift
    return [
        view.model_copy(update={"shift": (right + x / height, up + y / height)}) for x, y in positions(samples).tolist()
    ]
