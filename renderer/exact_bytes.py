"""Bytes that the exact techniques need for a frame, from its counts alone: also where a frame does not fit.

The techniques report the same for what they rendered; `tests/differential/test_exact_bytes.py` compares both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.techniques.abuffer_list import NODE_BYTES
from renderer.techniques.chain import SLOT_BYTES
from renderer.techniques.peeling import BACK_BYTES, SIDE_BYTES
from schemas.limits import LIMITS

_WORD_BYTES = 4
"""Bytes a pixel of a count that becomes an offset or a cursor, or of a head of a list."""


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
        "sbuffer": (SLOT_BYTES * total, _WORD_BYTES),
        "abuffer-list": (NODE_BYTES * total, 2 * _WORD_BYTES),
        "abuffer-array": (SLOT_BYTES * most * pixels, _WORD_BYTES),
        "depth-peeling": (0, SIDE_BYTES),
        "dual-depth-peeling": (0, 2 * SIDE_BYTES + BACK_BYTES),
    }
    found = pools.get(name)
    return None if found is None else ExactBytes(*found, pixels)


def fits(pool_bytes: int) -> bool:
    """Whether a pool is no larger than one storage buffer may be; larger ones are rendered in bands of rows."""
    return pool_bytes <= LIMITS.buffer_bytes
