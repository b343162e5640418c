"""Triangles of concave polygons: ear clipping (Meisters 1975), for the few faces that a fan does not suit."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


def clip_ears(
    places: NDArray[np.float64],
    corners: NDArray[np.int64],
    triangles: NDArray[np.int64],
    starts: NDArray[np.int64],
    sizes: NDArray[np.int64],
    slots: NDArray[np.int64],
) -> NDArray[np.int64]:
    """The triangles, with those of some faces replaced.

    Args:
        places: float64 [P, 3], points.
        corners: int64 [C], point of each corner.
        triangles: int64 [T, 3], corner indices.
        starts: int64 [n], first corner of each face to cut.
        sizes: int64 [n], its corners.
        slots: int64 [n], its first row among the triangles; it has `sizes - 2` of them.
    """
    if not len(starts):
        return triangles
    changed = triangles.copy()
    for start, size, slot in zip(starts.tolist(), sizes.tolist(), slots.tolist(), strict=True):
        flat = _flattened(places[corners[start : start + size]])
        changed[slot : slot + size - 2] = start + _ears(flat)
    return changed


def _flattened(polygon: NDArray[np.float64]) -> NDArray[np.float64]:
    """A polygon in the coordinate plane that it is closest to, wound counter-clockwise, float64 [n, 2]."""
    shifted = polygon - polygon.mean(axis=0)
    normal = np.cross(shifted, np.roll(shifted, -1, axis=0)).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    u, v = (axis + 1) % 3, (axis + 2) % 3
    return np.ascontiguousarray(shifted[:, [u, v] if normal[axis] >= 0.0 else [v, u]])


@njit(cache=True)
def _ears(flat: NDArray[np.float64]) -> NDArray[np.int64]:
    """Corner numbers of the n - 2 triangles of a simple counter-clockwise polygon, int64 [n - 2, 3]."""
    ring = np.arange(len(flat))
    triangles = np.empty((len(flat) - 2, 3), np.int64)
    at = 0
    for done in range(len(flat) - 2):
        left = len(flat) - done
        chosen, widest = -1, 0
        for step in range(left):
            i = (at + step) % left
            if _is_ear(flat, ring, left, i):
                chosen = i
                break
            if _turn_at(flat, ring, left, i) > _turn_at(flat, ring, left, widest):
                widest = i
        # A polygon that crosses itself may have no ear: then its widest corner goes.
        if chosen < 0:
            chosen = widest
        triangles[done, 0] = ring[(chosen - 1) % left]
        triangles[done, 1] = ring[chosen]
        triangles[done, 2] = ring[(chosen + 1) % left]
        for j in range(chosen, left - 1):
            ring[j] = ring[j + 1]
        # Going on behind the neighbour makes fewer slivers than staying.
        at = (chosen + 1) % (left - 1)
    return triangles


@njit(cache=True)
def _is_ear(flat: NDArray[np.float64], ring: NDArray[np.int64], left: int, i: int) -> bool:
    """Whether corner i of what is left turns left and no other corner is in its triangle."""
    a, b, c = flat[ring[(i - 1) % left]], flat[ring[i]], flat[ring[(i + 1) % left]]
    if _turn(a, b, c) <= 0.0:
        return False
    for j in range(2, left - 1):
        p = flat[ring[(i + j) % left]]
        inside = _turn(a, b, p) >= 0.0 and _turn(b, c, p) >= 0.0 and _turn(c, a, p) >= 0.0
        # A hole is joined to its outline by a seam whose corners stand twice in the same place.
        if inside and not _same(p, a) and not _same(p, b) and not _same(p, c):
            return False
    return True


@njit(cache=True)
def _turn_at(flat: NDArray[np.float64], ring: NDArray[np.int64], left: int, i: int) -> float:
    return _turn(flat[ring[(i - 1) % left]], flat[ring[i]], flat[ring[(i + 1) % left]])


@njit(cache=True)
def _turn(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> float:
    """Twice the signed area of a triangle."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


@njit(cache=True)
def _same(a: NDArray[np.float64], b: NDArray[np.float64]) -> bool:
    return bool(a[0] == b[0] and a[1] == b[1])
