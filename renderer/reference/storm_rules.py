"""Twin of `storm-rules`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.reference.arrivals import composited


def picture(
    offsets: NDArray[np.int64],
    packed: NDArray[np.uint32],
    depth: NDArray[np.float32],
    background: NDArray[np.uint8],
    nodes: int = 8,
) -> NDArray[np.float64]:
    """The picture, fragments of a pixel in their order of arrival.

    Args:
        offsets: int64 [P+1].
        packed: uint32 [N], stored colours.
        depth: float32 [N], metres.
        background: uint8 [P, 3], gamma-2 encoded.
        nodes: Fragments of a list that are read.

    Returns:
        float64 [P, 3], linear RGB.
    """
    return composited(offsets, packed, depth, background, lambda walked: _nearest_first(walked[:nodes]))


def _nearest_first(walked: list[tuple[float, int]]) -> list[int]:
    # Stable: of equal depths the newest comes first.
    return [word for _, word in sorted(walked, key=lambda one: one[0])]
