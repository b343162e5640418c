"""Splitting a window into bands of rows whose fragments fit a storage buffer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.problem import ExitCode, Problem


def row_bands(offsets: NDArray[np.int64], width: int, capacity: int) -> list[tuple[int, int]]:
    """Split rows into bands of at most `capacity` fragments.

    Args:
        offsets: int64 [P+1].
        width: Pixels per row.
        capacity: Fragments that a storage buffer holds.

    Returns:
        First row and number of rows of every band that has fragments.

    Raises:
        Problem: One row alone has more.
    """
    ends = offsets[::width]
    bands: list[tuple[int, int]] = []
    row, rows = 0, len(ends) - 1
    while row < rows:
        until = int(np.searchsorted(ends, ends[row] + capacity, side="right")) - 1
        if until <= row:
            raise Problem(
                f"Row {row} alone has more than {capacity:,} transparent fragments.",
                "Ask for a smaller --size.",
                ExitCode.LIMIT,
            )
        until = min(until, rows)
        if ends[until] > ends[row]:
            bands.append((row, until - row))
        row = until
    return bands
