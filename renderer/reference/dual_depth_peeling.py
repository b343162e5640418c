"""Twin of `dual-depth-peeling`: the nearest and the farthest of what is left, until nothing is; nothing is sorted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.reference.exact import Key, Light, keys_of
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump


def picture(dump: FragmentDump) -> NDArray[np.float64]:
    """The picture: float64 [P, 3], linear RGB."""
    background = decode_gamma2(dump.background)
    made = np.empty_like(background)
    for p in range(dump.pixels):
        front, back = _peeled(keys_of(dump, p))
        made[p] = front.over(back.over(background[p]))
    return made


def _peeled(keys: list[Key]) -> tuple[Light, Light]:
    front, back = Light.none(), Light.none()
    while keys:
        nearest, farthest = min(keys), max(keys)
        for _ in range(keys.count(nearest)):
            front.add_behind(nearest[1])
        if farthest != nearest:
            for _ in range(keys.count(farthest)):
                back.add_in_front(farthest[1])
        keys = [key for key in keys if nearest < key < farthest]
    return front, back
