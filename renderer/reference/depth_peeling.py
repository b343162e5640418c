"""Twin of `depth-peeling`: one layer after the other, each the nearest behind the last; nothing is sorted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.reference.exact import Key, Light, keys_of
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump


def picture(dump: FragmentDump) -> NDArray[np.float64]:
    """The picture: float64 [P, 3], linear RGB."""
    behind = decode_gamma2(dump.background)
    return np.array([_peeled(keys_of(dump, p)).over(behind[p]) for p in range(dump.pixels)])


def _peeled(keys: list[Key]) -> Light:
    light = Light.none()
    last: Key = (0.0, 0)
    while farther := [key for key in keys if key > last]:
        last = min(farther)
        for _ in range(farther.count(last)):  # fragments of equal depth and colour are one layer, repeated
            light.add_behind(last[1])
    return light
