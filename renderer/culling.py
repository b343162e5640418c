"""Which triangles a camera cannot see: runs of them whose bounds lie outside the frustum are not drawn.

Exact: a triangle outside one clip plane makes no fragment. Clusters are runs of the index buffer, because exporters
write neighbouring triangles one after the other.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from schemas.scene import Batch, SceneArrays

CLUSTER = 1024
"""Triangles of a cluster."""
_MARGIN = 1e-4
"""By what share of w a bound may be outside and still be drawn: sub-pixel snapping."""
_ROUNDING = 2.0**-20
"""By what share of the terms that a clip coordinate is the sum of: two products of four terms in float32.
It matters where positions are large for what is seen: the eye's distance from the origin cancels."""

Ranges = list[tuple[int, int]]
"""First triangle and number of triangles of runs."""


class Clusters:
    """The clusters of a scene.

    Args:
        scene: Its triangles; every batch is split by itself.
    """

    def __init__(self, scene: SceneArrays) -> None:
        starts = [_starts(batch) for batch in scene.batches]
        self._batches = np.repeat(np.arange(len(starts)), [len(s) for s in starts])
        self._first = np.concatenate([*starts, np.zeros(0, dtype=np.int64)])
        ends = np.array([(batch.first + batch.count) // 3 for batch in scene.batches], dtype=np.int64)
        self._end = np.minimum(self._first + CLUSTER, ends[self._batches])
        self._count = len(scene.batches)
        self._bounds = np.empty((len(self._first), 2, 3))
        _measure(scene.positions, scene.indices, self._first, self._end, self._bounds)

    def visible(self, projection: NDArray[np.float64], to_view: NDArray[np.float64]) -> tuple[list[Ranges], int]:
        """What a camera may see of every batch.

        Args:
            projection: float64 [4, 4], view to clip space (column vectors), z in [-w, w].
            to_view: float64 [4, 4], world to view space.

        Returns:
            For every batch its visible runs, and how many triangles are in none.
        """
        seen = ~_outside(self._bounds, projection, to_view)
        ranges: list[Ranges] = [[] for _ in range(self._count)]
        left_out = 0
        for batch, first, end, is_seen in zip(self._batches, self._first, self._end, seen, strict=True):
            runs = ranges[batch]
            if not is_seen:
                left_out += int(end - first)
            elif runs and runs[-1][0] + runs[-1][1] == first:
                runs[-1] = (runs[-1][0], runs[-1][1] + int(end - first))
            else:
                runs.append((int(first), int(end - first)))
        return ranges, left_out


def _starts(batch: Batch) -> NDArray[np.int64]:
    return np.arange(batch.first // 3, (batch.first + batch.count) // 3, CLUSTER, dtype=np.int64)


def _outside(
    bounds: NDArray[np.float64], projection: NDArray[np.float64], to_view: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Bool [C]: all eight corners are beyond the same clip plane, by more than a shader's float32 may be wrong."""
    corners = np.stack([bounds[:, (i, j, k), (0, 1, 2)] for i in (0, 1) for j in (0, 1) for k in (0, 1)], axis=1)
    x, y, z, w = _transformed(corners, projection @ to_view)
    # The same sums without signs, which is what roundings are relative to.
    size_x, size_y, size_z, size_w = _transformed(np.abs(corners), np.abs(projection) @ np.abs(to_view))
    outside = np.zeros(len(bounds), dtype=bool)
    for coordinate, size in ((x, size_x), (y, size_y), (z, size_z)):
        slack = _MARGIN * np.abs(w) + _ROUNDING * (size + size_w)
        for side in (w + coordinate, w - coordinate):
            outside |= (side < -slack).all(axis=1)
    return outside


def _transformed(points: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """[4, ...]: homogeneous coordinates of points [..., 3]."""
    return np.moveaxis(points @ matrix[:, :3].T + matrix[:, 3], -1, 0)


@njit(parallel=True, cache=True, nogil=True)
def _measure(
    positions: NDArray[np.float32],
    indices: NDArray[np.uint32],
    first: NDArray[np.int64],
    end: NDArray[np.int64],
    bounds: NDArray[np.float64],
) -> None:
    for cluster in prange(len(first)):
        for axis in range(3):
            low, high = np.inf, -np.inf
            for corner in range(3 * first[cluster], 3 * end[cluster]):
                value = np.float64(positions[indices[corner], axis])
                low, high = min(low, value), max(high, value)
            bounds[cluster, 0, axis], bounds[cluster, 1, axis] = low, high
