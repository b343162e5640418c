"""Every triangle that a pixel's ray meets, or may meet once a rasteriser has rounded its corners: exactly, in float64.

A rasteriser moves the corners of a triangle before it decides which pixel centres are inside: it rounds matrix,
products and sums to float32, then snaps to 1/256 of a pixel (`GL_SUBPIXEL_BITS` is 8). A triangle whose corners move
by at most d covers every centre that is inside by more than d, and none that is outside by more than d: both sets are
convex, and the Hausdorff distance of convex hulls is at most the largest distance of their points. So a hit is
*certain*, *possible* (within d of an edge) or absent, and d follows from the arithmetic; nothing is tuned.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

CERTAIN, AT_EDGE, AT_CLIP = 0, 1, 2
"""How sure a hit is: inside by more than the rounding, near an edge of the triangle, near a clip plane."""

_EPSILON = 2.0**-24
"""Half the distance of neighbouring float32 near 1: the rounding of one operation."""
_OPERATIONS = 6.0
"""Roundings of a term of a view-space coordinate: of the matrix, the product, up to three sums; one to spare."""
_SNAP = 2.0**0.5 / 512.0
"""Pixels that snapping to 1/256 moves a corner, at most."""
_WINDOW = 8.0
"""Roundings of a window coordinate or a depth after that: projection, division, viewport, plane equation."""


@numba.njit(cache=True)
def search(
    positions: NDArray[np.float32],
    indices: NDArray[np.uint32],
    to_view: Floats,
    projection: Floats,
    clip: Floats,
    grid: Integers,
    origins: Floats,
    directions: Floats,
    orthographic: bool,
) -> tuple[Integers, Floats]:
    """Rows of (sample, triangle, inside, doubt) and of the float64 attributes of Hits."""
    height, width = grid.shape
    numbers, reals = np.empty((1 << 14, 4), dtype=np.int64), np.empty((1 << 14, 13))
    count = 0
    corner = np.empty((3, 3))
    error = np.empty(3)
    polygon, window = np.empty((5, 3)), np.empty((5, 3))
    spare, flags, spare_flags = np.empty((5, 3)), np.empty(5, np.int64), np.empty(5, np.int64)
    for triangle in range(len(indices) // 3):
        _to_view(positions, indices, triangle, to_view, corner, error)
        size = _clip(corner, clip, polygon, flags, spare, spare_flags)
        if size == 0:
            continue
        _project(polygon, flags, size, error, projection, width, height, orthographic, window)
        box = _box(window, size, width, height)
        for y in range(box[2], box[3]):
            for x in range(box[0], box[1]):
                sample = grid[y, x]
                if sample < 0:
                    continue
                doubt, inside, moved = _covers(window, flags, size, x + 0.5, y + 0.5)
                if doubt < 0:
                    continue
                if count == len(numbers):
                    numbers = np.concatenate((numbers, np.empty_like(numbers)))
                    reals = np.concatenate((reals, np.empty_like(reals)))
                numbers[count, 0], numbers[count, 1] = sample, triangle
                numbers[count, 2], numbers[count, 3] = int(inside), doubt
                ray, turn = origins[sample], directions[sample]
                steps = 2.0 / (width * projection[0, 0]), 2.0 / (height * projection[1, 1])
                _measure(corner, polygon, size, ray, turn, steps, orthographic, error.max(), moved, reals[count])
                count += 1
    return numbers[:count], reals[:count]


@numba.njit(cache=True)
def _project(
    polygon: Floats,
    flags: Integers,
    size: int,
    error: Floats,
    projection: Floats,
    width: int,
    height: int,
    orthographic: bool,
    window: Floats,
) -> None:
    """Window x and y of the corners, and how far rounding and snapping may move them, pixels."""
    whole = size == 3 and flags[0] + flags[1] + flags[2] == 0
    focal = 0.5 * max(width * abs(projection[0, 0]), height * abs(projection[1, 1]))
    for k in range(size):
        scale = 1.0 if orthographic else -polygon[k, 2]
        window[k, 0] = 0.5 * width * (1.0 + _row(projection, 0, polygon[k]) / scale)
        window[k, 1] = 0.5 * height * (1.0 + _row(projection, 1, polygon[k]) / scale)
        slant = 0.0 if orthographic else (abs(polygon[k, 0]) + abs(polygon[k, 1])) / scale
        # A corner that clipping made is as uncertain as the corners it was made of.
        rounding = error[k] if whole else error.max()
        moved = _WINDOW * _EPSILON * (width + height + abs(window[k, 0]) + abs(window[k, 1]))
        window[k, 2] = _SNAP + moved + focal * rounding * (1.0 + slant) / scale


@numba.njit(cache=True)
def _box(window: Floats, size: int, width: int, height: int) -> tuple[int, int, int, int]:
    """Pixels whose centres may be inside: first and end column, first and end row."""
    left = (window[:size, 0] - window[:size, 2]).min()
    right = (window[:size, 0] + window[:size, 2]).max()
    top = (window[:size, 1] - window[:size, 2]).min()
    bottom = (window[:size, 1] + window[:size, 2]).max()
    return (
        int(np.ceil(min(max(left, 0.0), width) - 0.5)),
        int(np.floor(max(min(right, width), 0.0) + 0.5)),
        int(np.ceil(min(max(top, 0.0), height) - 0.5)),
        int(np.floor(max(min(bottom, height), 0.0) + 0.5)),
    )


@numba.njit(cache=True)
def _row(matrix: Floats, row: int, point: Floats) -> float:
    return float(matrix[row, 0] * point[0] + matrix[row, 1] * point[1] + matrix[row, 2] * point[2] + matrix[row, 3])


@numba.njit(cache=True)
def _to_view(
    positions: NDArray[np.float32],
    indices: NDArray[np.uint32],
    triangle: int,
    to_view: Floats,
    corner: Floats,
    error: Floats,
) -> None:
    """The corners in view space and how far float32 may be from them, metres."""
    for k in range(3):
        vertex = indices[3 * triangle + k]
        error[k] = 0.0
        for row in range(3):
            total, size = to_view[row, 3], abs(to_view[row, 3])
            for column in range(3):
                term = to_view[row, column] * positions[vertex, column]
                total += term
                size += abs(term)
            corner[k, row] = total
            error[k] = max(error[k], _OPERATIONS * _EPSILON * size)


@numba.njit(cache=True)
def _clip(corner: Floats, clip: Floats, polygon: Floats, flags: Integers, spare: Floats, spare_flags: Integers) -> int:
    """Sutherland and Hodgman 1974 against near and far; flag k: the edge from corner k lies in a clip plane."""
    size = 3
    for k in range(3):
        polygon[k], flags[k] = corner[k], 0
    for plane in range(2):
        sign, offset = (1.0, -clip[0]) if plane == 0 else (-1.0, clip[1])
        kept = 0
        for k in range(size):
            following = (k + 1) % size
            here, there = -sign * polygon[k, 2] + offset, -sign * polygon[following, 2] + offset
            if here >= 0.0:
                spare[kept], spare_flags[kept] = polygon[k], flags[k]
                kept += 1
            if (here >= 0.0) != (there >= 0.0):
                share = here / (here - there)
                for axis in range(3):
                    spare[kept, axis] = polygon[k, axis] + share * (polygon[following, axis] - polygon[k, axis])
                spare_flags[kept] = 1 if here >= 0.0 else flags[k]
                kept += 1
        size = kept
        for k in range(size):
            polygon[k], flags[k] = spare[k], spare_flags[k]
        if size < 3:
            return 0
    return size


@numba.njit(cache=True)
def _covers(window: Floats, flags: Integers, size: int, x: float, y: float) -> tuple[int, bool, float]:
    """Doubt (-1: absent), whether the exact polygon holds the point, and how far corners near it may move, pixels."""
    area = 0.0
    for k in range(size):
        following = (k + 1) % size
        area += window[k, 0] * window[following, 1] - window[k, 1] * window[following, 0]
    turn = 1.0 if area >= 0.0 else -1.0
    inside, doubt, moved = area != 0.0, CERTAIN, 0.0
    nearest, allowed = np.inf, 0.0
    for k in range(size):
        following = (k + 1) % size
        ax, ay = window[k, 0], window[k, 1]
        dx, dy = window[following, 0] - ax, window[following, 1] - ay
        squared = dx * dx + dy * dy
        share = 0.0
        if squared > 0.0:
            share = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / squared))
        distance = np.hypot(x - ax - share * dx, y - ay - share * dy)
        rounding = (1.0 - share) * window[k, 2] + share * window[following, 2]
        moved = max(moved, rounding)
        if turn * (dx * (y - ay) - dy * (x - ax)) < 0.0:
            inside = False
        if distance <= rounding:
            doubt = max(doubt, AT_CLIP if flags[k] else AT_EDGE)
        if distance - rounding < nearest - allowed:
            nearest, allowed = distance, rounding
    if doubt == CERTAIN and not inside:
        return -1, False, moved
    return doubt, inside, moved


@numba.njit(cache=True)
def _plane(corner: Floats, normal: Floats, origin: Floats, direction: Floats) -> float:
    """Depth at which a ray meets the plane of the corners; infinite where it is parallel."""
    across = normal[0] * direction[0] + normal[1] * direction[1] + normal[2] * direction[2]
    away = 0.0
    for axis in range(3):
        away += normal[axis] * (corner[0, axis] - origin[axis])
    return away / across if across != 0.0 else np.inf


@numba.njit(cache=True)
def _weights(corner: Floats, normal: Floats, point: Floats, out: Floats) -> None:
    squared = normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2
    for k in range(3):
        a, b = corner[(k + 1) % 3], corner[(k + 2) % 3]
        area = np.cross(b - a, point - a)
        out[k] = (area[0] * normal[0] + area[1] * normal[1] + area[2] * normal[2]) / squared if squared > 0.0 else 1 / 3


@numba.njit(cache=True)
def _measure(
    corner: Floats,
    polygon: Floats,
    size: int,
    origin: Floats,
    direction: Floats,
    steps: tuple[float, float],
    orthographic: bool,
    error: float,
    moved: float,
    out: Floats,
) -> None:
    """Fills one row: depth, its least and greatest value, slope, weights and their changes."""
    normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    depth = _plane(corner, normal, origin, direction)
    across = abs((normal * direction).sum())
    _weights(corner, normal, origin + depth * direction, out[4:7])
    steep = 0.0
    for axis in range(2):
        start, turned = origin.copy(), direction.copy()
        if orthographic:
            start[axis] += steps[axis]
        else:
            turned[axis] += steps[axis]
        _weights(
            corner, normal, start + _plane(corner, normal, start, turned) * turned, out[7 + 3 * axis : 10 + 3 * axis]
        )
        out[7 + 3 * axis : 10 + 3 * axis] -= out[4:7]
        # Derivative of the depth at which the ray meets the plane, by the pixel.
        change = abs(normal[axis] * steps[axis]) * (1.0 if orthographic else abs(depth))
        steep = np.hypot(steep, change / across if across > 0.0 else np.inf)
    # Rounding of the corners, of the depth itself, and of where in the plane the fragment is.
    tolerance = error + _WINDOW * _EPSILON * abs(depth) + steep * moved
    out[0], out[1], out[2], out[3] = depth, depth - tolerance, depth + tolerance, steep
    if not np.isfinite(tolerance):
        # Seen exactly from the edge: a fragment of it may be at any depth of the triangle.
        low, high = (-polygon[:size, 2]).min(), (-polygon[:size, 2]).max()
        out[0], out[1], out[2] = 0.5 * (low + high), low - error, high + error
