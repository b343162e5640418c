"""CSR on the CPU: offsets from counts, and the sort inside every pixel."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

_INSERTION = 24
"""Up to this many fragments insertion sort beats the general one (most pixels)."""


def offsets_of(counts: NDArray[np.integer]) -> NDArray[np.int64]:
    """Exclusive prefix sum: int64 [P+1] of counts [P]."""
    offsets = np.zeros(len(counts) + 1, dtype=np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets


@njit(parallel=True, cache=True, nogil=True)
def sort_fragments(offsets: NDArray[np.int64], keys: NDArray[np.uint64]) -> None:
    """Sort the keys of every pixel in place.

    Args:
        offsets: int64 [P+1].
        keys: uint64 [N], depth bits in the high word, packed colour in the low one.
    """
    for p in prange(len(offsets) - 1):
        begin, end = offsets[p], offsets[p + 1]
        if end - begin > _INSERTION:
            keys[begin:end] = np.sort(keys[begin:end])
            continue
        for i in range(begin + 1, end):
            key = keys[i]
            j = i - 1
            while j >= begin and keys[j] > key:
                keys[j + 1] = keys[j]
                j -= 1
            keys[j + 1] = key
