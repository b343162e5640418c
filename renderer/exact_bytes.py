"""Bytes that the exact techniques need for a frame, from its counts alone: also where a frame does not fit.

The techniques report the same for what they rendered; `tests/differential/test_exact_bytes.py` compares both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.techniques.abuffer_list import NODE_BYTES
from renderer.techniques.chain import SLOT_BYTES
from renderer.techniques.peeling import LIGHT_BYTES, SIDE
from schemas.limits import LIMITS

_COUNT_BYTES = 12
"""Bytes a pixel of the count pass: n, z_min, z_max."""
_WORD_BYTES = 4
"""Bytes a pixel of an offset, a cursor, a head, or a place in a list of pixels."""
_SIDE_BYTES = SIDE.itemsize + LIGHT_BYTES


@dataclass(frozen=True, slots=True)
class ExactBytes:
    """What a frame takes, as `renderer.techniques.Rendered` has it.

    Attributes:
        pool: Bytes of storage that depend on the number of fragments.
        pixel: Bytes a pixel of all other buffers.
        pixels: P.
    """

    pool: int
    pixel: int
    pixels: int

    @property
    def total(self) -> int:
        """Of the whole frame."""
        return self.pool + self.pixel * self.pixels


def exact_bytes(name: str, n: NDArray[np.integer]) -> ExactBytes | None:
    """Bytes that a technique needs to render a frame exactly; None for techniques that are not exact.

    Args:
        name: The technique.
        n: Transparent fragments of each pixel, int [P].
    """
    total, most, pixels = int(n.sum(dtype=np.int64)), int(n.max(initial=0)), len(n)
    pools = {
        "sbuffer": (SLOT_BYTES * total, _COUNT_BYTES + _WORD_BYTES),
        "abuffer-list": (NODE_BYTES * total, _COUNT_BYTES + 2 * _WORD_BYTES),
        "abuffer-array": (SLOT_BYTES * most * pixels, _COUNT_BYTES + 2 * _WORD_BYTES),
        "depth-peeling": (0, _COUNT_BYTES + _SIDE_BYTES + _WORD_BYTES),
        "dual-depth-peeling": (0, _COUNT_BYTES + 2 * _SIDE_BYTES + _WORD_BYTES),
    }
    found = pools.get(name)
    return None if found is None else ExactBytes(*found, pixels)


def fits(pool_bytes: int) -> bool:
    """Whether a pool is no larger than one storage buffer may be; larger ones are rendered in bands of rows."""
    return pool_bytes <= LIMITS.buffer_bytes
