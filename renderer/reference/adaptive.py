"""Twin of `adaptive`.

Which node goes is decided on float32 areas, as in the shader: near ties would else be decided otherwise now and then,
and every later node would differ. Each of those operations is one rounding in IEEE arithmetic, so both sides agree on
every bit, but for subnormal numbers, which change nothing that could be seen. Colours and the transmittances that they
are weighted with are float64.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.colour import decode_gamma2

_LEVEL = np.float32(1.0) / np.float32(255.0)

_Key = tuple[float, int, int]
"""Depth, packed colour, place in the run."""


@dataclass(slots=True)
class Curve:
    """A visibility function: behind `keys[i]` the transmittance is `trans[i]`, in front of all 1.

    Attributes:
        keys: Ascending.
        trans: float64.
        rounded: The same in float32, for decisions.
    """

    keys: list[_Key]
    trans: list[float]
    rounded: list[np.float32]

    def before(self, key: _Key) -> float:
        """The transmittance of everything nearer than a fragment."""
        at = bisect_left(self.keys, key)
        return self.trans[at - 1] if at else 1.0

    def insert(self, key: _Key, alpha: int) -> None:
        """Add a fragment: nodes behind it become darker."""
        at = bisect_left(self.keys, key)
        rounded_before = self.rounded[at - 1] if at else np.float32(1.0)
        self.trans.insert(at, self.before(key))
        self.keys.insert(at, key)
        self.rounded.insert(at, rounded_before)
        through = np.float32(255 - alpha) * _LEVEL
        for i in range(at, len(self.keys)):
            self.trans[i] *= 1.0 - alpha / 255.0
            self.rounded[i] *= through

    def remove_least(self) -> None:
        """Remove the inner node that takes the least area away; ties: the nearest."""
        depths = [np.float32(key[0]) for key in self.keys]
        areas = [
            (depths[i] - depths[i - 1]) * (self.rounded[i - 1] - self.rounded[i]) for i in range(1, len(depths) - 1)
        ]
        least = 1 + int(np.argmin(areas))
        del self.keys[least], self.trans[least - 1], self.rounded[least - 1]


def curve(packed: NDArray[np.uint32], depth: NDArray[np.float32], nodes: int) -> Curve:
    """The compressed visibility function of one pixel (Salvi et al. 2011, section 4).

    Args:
        packed: uint32 [n], in the order of arrival.
        depth: float32 [n], metres.
        nodes: Nodes at most.
    """
    made = Curve([], [], [])
    for i in range(len(packed)):
        made.insert((float(depth[i]), int(packed[i]), i), int(packed[i]) >> 24)
        if len(made.keys) > nodes:
            made.remove_least()
    return made


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
        nodes: Nodes of a visibility function.

    Returns:
        float64 [P, 3], linear RGB.
    """
    behind = decode_gamma2(background)
    made = np.empty_like(behind)
    for p in range(len(behind)):
        run = slice(offsets[p], offsets[p + 1])
        made[p] = _pixel(packed[run], depth[run], behind[p], nodes)
    return made


def _pixel(
    packed: NDArray[np.uint32], depth: NDArray[np.float32], behind: NDArray[np.float64], nodes: int
) -> NDArray[np.float64]:
    if not len(packed):
        return behind
    visibility = curve(packed, depth, nodes)
    rgba = packed.astype("<u4").view(np.uint8).reshape(-1, 4)
    seen = np.array([visibility.before((float(depth[i]), int(packed[i]), i)) for i in range(len(packed))])
    weights = seen * rgba[:, 3] / 255.0
    colour: NDArray[np.float64] = weights @ decode_gamma2(rgba[:, :3]) + visibility.trans[-1] * behind
    return colour
