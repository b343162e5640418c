"""What a pixel shows without light, here and in Storm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_LEAST = 0.5 / 255.0
"""Alpha that is stored as 0 in 8 bits is nothing."""

Planes = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Seen:
    """A picture without light.

    Attributes:
        rgba: float32 [H, W, 4], linear, premultiplied, over black; alpha is 1 - the product of (1 - a).
        depth: float32 [H, W], of the nearest opaque surface along the view axis, stage units; infinite where none is.
    """

    rgba: Planes
    depth: Planes

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Where anything is, bool [H, W]."""
        return np.isfinite(self.depth) | (self.rgba[..., 3] > _LEAST)
