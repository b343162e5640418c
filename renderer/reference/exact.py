"""Twin of the exact techniques that store all fragments: `sbuffer`, `abuffer-list`, `abuffer-array`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump

Key = tuple[float, int]
"""Depth in metres and packed colour: what fragments are ordered by."""


@dataclass(slots=True)
class Light:
    """Light of some layers, composited with the running product of 1 - alpha (METHOD.md section 2).

    Attributes:
        rgb: float64 [3], linear, premultiplied.
        transmittance: What the layers let through.
    """

    rgb: NDArray[np.float64]
    transmittance: float = 1.0

    @classmethod
    def none(cls) -> Light:
        """No layer at all."""
        return cls(np.zeros(3))

    def add_behind(self, word: int) -> None:
        """Add a layer behind all others, by its packed colour."""
        colour, alpha = unpacked(word)
        self.rgb = self.rgb + self.transmittance * alpha * colour
        self.transmittance *= 1.0 - alpha

    def add_in_front(self, word: int) -> None:
        """Add a layer in front of all others, by its packed colour."""
        colour, alpha = unpacked(word)
        self.rgb = alpha * colour + (1.0 - alpha) * self.rgb
        self.transmittance *= 1.0 - alpha

    def over(self, behind: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [3], the layers over a colour.

        Args:
            behind: float64 [3], linear RGB of what lies behind the layers.
        """
        return np.asarray(self.rgb + self.transmittance * behind)


def unpacked(word: int) -> tuple[NDArray[np.float64], float]:
    """Linear RGB float64 [3] and alpha of a packed colour (bytes r, g, b, a from the lowest)."""
    stored = np.array([word & 255, word >> 8 & 255, word >> 16 & 255], dtype=np.uint8)
    return decode_gamma2(stored), (word >> 24) / 255.0


def keys_of(dump: FragmentDump, p: int) -> list[Key]:
    """Keys of a pixel's fragments, in the order in which they are stored."""
    part = slice(dump.offsets[p], dump.offsets[p + 1])
    words = np.ascontiguousarray(dump.rgba[part]).view("<u4")[:, 0]
    return list(zip(dump.depth[part].tolist(), words.tolist(), strict=True))


def picture(dump: FragmentDump) -> NDArray[np.float64]:
    """Every fragment front to back, ties by packed colour: float64 [P, 3], linear RGB.

    The order in which a pixel's fragments are stored makes no difference.
    """
    behind = decode_gamma2(dump.background)
    made = np.empty_like(behind)
    for p in range(dump.pixels):
        light = Light.none()
        for _, word in sorted(keys_of(dump, p)):
            light.add_behind(word)
        made[p] = light.over(behind[p])
    return made
