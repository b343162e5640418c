"""Twin of `multilayer`."""

from __future__ import annotations

from bisect import insort

import numpy as np
from numpy.typing import NDArray

from schemas.colour import decode_gamma2

_Key = tuple[float, int]
_Layer = tuple[_Key, NDArray[np.float64], float]
"""(depth, packed colour), premultiplied linear RGB, transmittance."""


def layers(packed: NDArray[np.uint32], depth: NDArray[np.float32], nodes: int) -> list[_Layer]:
    """The layers of one pixel, nearest first (Salvi and Vaidyanathan 2014, section 3).

    Args:
        packed: uint32 [n], in the order of arrival.
        depth: float32 [n], metres.
        nodes: Layers at most.
    """
    kept: list[_Layer] = []
    rgba = packed.astype("<u4").view(np.uint8).reshape(-1, 4)
    linear, alpha = decode_gamma2(rgba[:, :3]), rgba[:, 3] / 255.0
    for i in range(len(packed)):
        key = (float(depth[i]), int(packed[i]))
        insort(kept, (key, alpha[i] * linear[i], float(1.0 - alpha[i])), key=lambda layer: layer[0])
        if len(kept) > nodes:
            (_, far_colour, far_through), (near, colour, through) = kept.pop(), kept.pop()
            kept.append((near, colour + through * far_colour, through * far_through))
    return kept


def picture(
    offsets: NDArray[np.int64],
    packed: NDArray[np.uint32],
    depth: NDArray[np.float32],
    background: NDArray[np.uint8],
    nodes: int = 4,
) -> NDArray[np.float64]:
    """The picture, fragments of a pixel in their order of arrival.

    Args:
        offsets: int64 [P+1].
        packed: uint32 [N], stored colours.
        depth: float32 [N], metres.
        background: uint8 [P, 3], gamma-2 encoded.
        nodes: Layers a pixel.

    Returns:
        float64 [P, 3], linear RGB.
    """
    behind = decode_gamma2(background)
    made = np.empty_like(behind)
    for p in range(len(behind)):
        run = slice(offsets[p], offsets[p + 1])
        colour, transmittance = np.zeros(3), 1.0
        for _, premultiplied, through in layers(packed[run], depth[run], nodes):
            colour = colour + transmittance * premultiplied
            transmittance *= through
        made[p] = colour + transmittance * behind[p]
    return made
