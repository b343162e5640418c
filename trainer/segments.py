"""Segments of hulls in CSR form: made of their vertices, and looked up for the bins of a batch."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np
from numpy.typing import NDArray

SEGMENTS: Final = 24
"""Hull segments per pixel; longer hulls are simplified to this many."""


@numba.njit(cache=True, nogil=True)
def hull_segments(
    hull_offsets: NDArray[np.int64], hull_k: NDArray[np.int32], hull_error: NDArray[np.float32]
) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.float32]]:
    """CSR segments of hulls given by their vertices, at most SEGMENTS each.

    Leaving out a vertex replaces two segments by their chord: the hull stays convex and never lies below the
    true one. The vertex whose removal adds the least area goes first.

    Args:
        hull_offsets: int64 [R+1], vertices of row r are `hull_offsets[r]:hull_offsets[r+1]`.
        hull_k: int32 [M], fragments.
        hull_error: float32 [M], squared error.

    Returns:
        Offsets int64 [R+1], slopes float32 [S] (error gained per fragment, > 0), lengths float32 [S] (fragments).
    """
    rows = len(hull_offsets) - 1
    offsets = np.zeros(rows + 1, dtype=np.int64)
    slopes = np.empty(len(hull_k), dtype=np.float32)
    lengths = np.empty(len(hull_k), dtype=np.float32)
    used = 0
    for r in range(rows):
        k = hull_k[hull_offsets[r] : hull_offsets[r + 1]].astype(np.float64)
        e = hull_error[hull_offsets[r] : hull_offsets[r + 1]].astype(np.float64)
        count = len(k)
        while count > SEGMENTS + 1:
            best, least = 1, np.inf
            for j in range(1, count - 1):
                chord = (k[j] - k[j - 1]) * (e[j + 1] - e[j - 1]) - (e[j] - e[j - 1]) * (k[j + 1] - k[j - 1])
                if chord < least:
                    best, least = j, chord
            k[best : count - 1] = k[best + 1 : count].copy()
            e[best : count - 1] = e[best + 1 : count].copy()
            count -= 1
        for j in range(count - 1):
            slopes[used] = (e[j] - e[j + 1]) / (k[j + 1] - k[j])
            lengths[used] = k[j + 1] - k[j]
            if slopes[used] > 0.0:
                used += 1
        offsets[r + 1] = used
    return offsets, slopes[:used].copy(), lengths[:used].copy()


@numba.njit(cache=True)
def bin_slopes(
    offsets: NDArray[np.int64],
    slopes: NDArray[np.float32],
    lengths: NDArray[np.float32],
    rows: NDArray[np.int64],
    counts: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """What each fragment of a bin gains, by the segment that its middle lies in; 0 behind the last one.

    Args:
        offsets: int64 [R+1], segments of row r are `offsets[r]:offsets[r+1]`.
        slopes: float32 [S].
        lengths: float32 [S].
        rows: int64 [B], rows, in any order.
        counts: float32 [B, bins], fragments of each bin of these rows.
        out: float32 [B, bins].
    """
    for i in range(len(rows)):
        j, last = offsets[rows[i]], offsets[rows[i] + 1]
        ends = lengths[j] if j < last else np.float32(0.0)
        before = np.float32(0.0)
        for b in range(counts.shape[1]):
            while j < last and before + 0.5 * counts[i, b] >= ends:
                j += 1
                ends += lengths[j] if j < last else np.float32(0.0)
            out[i, b] = slopes[j] if j < last else 0.0
            before += counts[i, b]
