"""Twins of what the engines' lists share: the fragments that come before a pool is full, composited in some order."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from renderer.csr import offsets_of
from renderer.reference.exact import Light
from renderer.techniques.ordered import Ordered
from schemas.colour import decode_gamma2


def arriving(found: Ordered, slots: int) -> Ordered:
    """The first fragments of a frame.

    Args:
        found: All of them.
        slots: How many fit.

    Returns:
        The first `slots` by triangle and pixel; those of a pixel in the order of submission, as before.
    """
    counts = np.diff(found.offsets)
    pixel = np.repeat(np.arange(len(counts)), counts)
    kept = np.zeros(len(found.rank), dtype=bool)
    kept[np.lexsort((pixel, found.rank))[:slots]] = True
    offsets = offsets_of(np.bincount(pixel[kept], minlength=len(counts)))
    return Ordered(offsets, found.packed[kept], found.depth[kept], found.rank[kept], found.passes)


def composited(
    offsets: NDArray[np.int64],
    packed: NDArray[np.uint32],
    depth: NDArray[np.float32],
    background: NDArray[np.uint8],
    order: Callable[[list[tuple[float, int]]], Iterable[int]],
) -> NDArray[np.float64]:
    """The picture of lists that are walked from the newest fragment.

    Args:
        offsets: int64 [P+1].
        packed: uint32 [N], stored colours, in the order of arrival.
        depth: float32 [N], metres.
        background: uint8 [P, 3], gamma-2 encoded.
        order: Depth and packed colour of a pixel's fragments, from the newest -> packed colours from the nearest.

    Returns:
        float64 [P, 3], linear RGB.
    """
    made = decode_gamma2(background)
    for p in range(len(made)):
        walked = range(offsets[p + 1] - 1, offsets[p] - 1, -1)
        light = Light.none()
        for word in order([(float(depth[i]), int(packed[i])) for i in walked]):
            light.add_behind(word)
        made[p] = light.over(made[p])
    return made
