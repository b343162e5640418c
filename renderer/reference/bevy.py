"""Twin of `bevy`."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

import numpy as np
from numpy.typing import NDArray

from renderer.reference.exact import Light
from schemas.colour import decode_gamma2

_Key = tuple[float, int]
"""Depth, and opacity so that more comes first."""


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
        nodes: Fragments that are sorted.

    Returns:
        float64 [P, 3], linear RGB.
    """
    made = decode_gamma2(background)
    for p in range(len(made)):
        walked = range(offsets[p + 1] - 1, offsets[p] - 1, -1)
        light = Light.none()
        for word in composited([(float(depth[i]), int(packed[i])) for i in walked], nodes):
            light.add_behind(word)
        made[p] = light.over(made[p])
    return made


def composited(walked: list[tuple[float, int]], nodes: int) -> list[int]:
    """Packed colours in the order in which they are composited.

    Args:
        walked: Depth and packed colour, from the newest.
        nodes: Fragments that are sorted.
    """
    early: list[int] = []
    keys: list[_Key] = []
    kept: list[int] = []
    for z, word in walked:
        key = z, -(word >> 24)
        if len(kept) < nodes:
            at = bisect_right(keys, key)
        elif keys[0] < key:
            early.append(kept.pop(0))
            keys.pop(0)
            at = bisect_left(keys, key)
        else:
            early.append(word)
            continue
        keys.insert(at, key)
        kept.insert(at, word)
    return early + kept
