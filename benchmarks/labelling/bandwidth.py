"""What a machine's memory can do, for comparison."""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from benchmarks.render.setup import in_turns


def copy_bandwidth(words: int) -> float:
    """Bytes per second, read and written, of a copy by all cores: the best of several.

    Args:
        words: 8 bytes each; far more than any cache.
    """
    source, target = np.ones(words, dtype=np.uint64), np.zeros(words, dtype=np.uint64)
    least = in_turns(5, {"copy": lambda: _copy(source, target)})["copy"]["least"]
    return 2e3 * source.nbytes / least


@njit(parallel=True, cache=True)
def _copy(source: NDArray[np.uint64], target: NDArray[np.uint64]) -> None:
    for i in prange(len(source)):
        target[i] = source[i]
