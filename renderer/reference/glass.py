"""Glass (docs/METHOD.md, section 1): what `common/glass.glsl` stores as the alpha of a fragment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def reflected(reflectance: tuple[float, float], cosine: Floats) -> Floats:
    """Fraction of light that is reflected: Schlick's approximation of Fresnel's equations.

    Args:
        reflectance: Facing the eye, and at a silhouette.
        cosine: float64 [N], |n . e| of unit normals and directions to the eye.
    """
    facing, silhouette = reflectance
    return np.asarray(facing + (silhouette - facing) * (1.0 - np.clip(cosine, 0.0, 1.0)) ** 5)


def levels(
    reflectance: tuple[float, float], cosine: Floats, transmittance: Floats, body: Floats, presence: Floats
) -> tuple[Floats, NDArray[np.uint8]]:
    """Stored alpha of fragments.

    Args:
        reflectance: As above.
        cosine: As above.
        transmittance: float64 [N], mean of the tint.
        body: float64 [N], share of light that is not transmitted.
        presence: float64 [N], opacity of all of it.

    Returns:
        Times 255 before it is rounded, and as it is stored.
    """
    through = (1.0 - reflected(reflectance, cosine)) * (1.0 - body) * transmittance
    level = 255.0 * presence * (1.0 - through)
    stored = np.clip(np.floor(level + 0.5), 1.0, 254.0)
    stored[255.0 * presence * body >= 254.5] = 255.0
    stored[255.0 * presence < 0.5] = 0.0
    return np.asarray(level), stored.astype(np.uint8)
