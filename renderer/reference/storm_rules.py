"""Twin of `storm-rules`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.reference.exact import Light
from schemas.colour import decode_gamma2


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
    made = decode_gamma2(background)
    for p in range(len(made)):
        walked = list(range(offsets[p], offsets[p + 1]))[::-1][:nodes]
        light = Light.none()
        for i in sorted(walked, key=lambda i: float(depth[i])):  # stable: of equal depths the newest first
            light.add_behind(int(packed[i]))
        made[p] = light.over(made[p])
    return made
