"""How far the opaque surface of each pixel is: the depth buffer in metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.frame import Frame


def opaque_depth(frame: Frame) -> NDArray[np.float32]:
    """Distance of the opaque surfaces along the view axis.

    Args:
        frame: The view, its opaque pass done.

    Returns:
        float32 [P], metres, row 0 at the top; infinite where there is none. The depth buffer has 24 bits between the
        near and the far plane, so it is coarser than a fragment's depth.
    """
    target = frame.target([frame.background])
    window = np.frombuffer(target.read(components=1, attachment=-1, dtype="f4"), dtype=np.float32).astype(np.float64)
    near, far = frame.view.clip_range(frame.gpu.scene.bounds)
    scale, offset = frame.view.projection(frame.width / frame.height, near, far)[2, 2:]
    ndc = 2.0 * window - 1.0
    # Clip z over clip w of a point at distance d: (offset - scale d) / d, or / 1 without perspective.
    perspective = frame.view.ortho_height is None
    distance = offset / (ndc + scale) if perspective else (offset - ndc) / scale
    return np.where(window < 1.0, distance, np.inf).astype(np.float32)
