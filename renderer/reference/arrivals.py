"""Twin of `renderer.techniques.arrivals`: the fragments that come before a pool is full, and those only."""

from __future__ import annotations

import numpy as np

from renderer.csr import offsets_of
from renderer.techniques.ordered import Ordered


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
