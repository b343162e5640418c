"""Whether triangles tessellate a gprim: corners on the surface that USD defines, and the right volume inside."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

Floats = NDArray[np.float64]

ON_SURFACE = 1e-5
"""Of the gprim's size: how far a corner may be from its surface."""
VOLUME = (0.93, 1.0 + 1e-4)
"""Least and greatest volume (of a Plane: area) inside an inscribed tessellation, of that of the gprim."""


def tessellates(prim: Usd.Prim, time: Usd.TimeCode, triangles: Floats, slack: float) -> NDArray[np.bool_]:
    """Which triangles have all corners on the surface of a gprim.

    Args:
        prim: Cube, Sphere, Cylinder, Cone, Capsule or Plane.
        time: When its attributes are read.
        triangles: float64 [T, 3, 3], in the gprim's own space.
        slack: Rounding of the corners, same unit.
    """
    distance, size = _surface(prim, time)
    return np.asarray(np.all(np.abs(distance(_upright(prim, time, triangles))) <= ON_SURFACE * size + slack, axis=1))


def reach(prim: Usd.Prim, time: Usd.TimeCode) -> float:
    """Greatest distance of a gprim's surface from its centre, at most."""
    return float(3.0**0.5 * _surface(prim, time)[1])


def volume_ratio(prim: Usd.Prim, time: Usd.TimeCode, triangles: Floats) -> float:
    """Volume inside closed triangles wound counter-clockwise, over that of the gprim; the same for a Plane's area."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    if prim.IsA(UsdGeom.Plane):
        area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
        return area / (_number(prim, "width", time) * _number(prim, "length", time))
    return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6.0) / _volume(prim, time)


def _number(prim: Usd.Prim, name: str, time: Usd.TimeCode) -> float:
    return float(prim.GetAttribute(name).Get(time))


def _upright(prim: Usd.Prim, time: Usd.TimeCode, points: Floats) -> Floats:
    """Axes turned cyclically so that the gprim's own axis is z."""
    axis = prim.GetAttribute("axis").Get(time) if prim.HasAttribute("axis") else "Z"
    return np.roll(points, {"X": 2, "Y": 1, "Z": 0}[str(axis)], axis=-1)


def _surface(prim: Usd.Prim, time: Usd.TimeCode) -> tuple[Callable[[Floats], Floats], float]:
    """Distance from the surface, or a bound of it, of points [..., 3] about the z axis, and the gprim's size."""
    if prim.IsA(UsdGeom.Cube):
        half = 0.5 * _number(prim, "size", time)
        return lambda p: np.abs(p).max(axis=-1) - half, half
    if prim.IsA(UsdGeom.Plane):
        sides = 0.5 * np.sort([_number(prim, "width", time), _number(prim, "length", time)])
        # Which of the two lies along which axis differs by axis: corners have both, in either order.
        return lambda p: np.abs(p[..., 2]) + np.abs(np.sort(np.abs(p[..., :2]), axis=-1) - sides).sum(-1), sides[1]
    radius = _number(prim, "radius", time)
    if prim.IsA(UsdGeom.Sphere):
        return lambda p: np.linalg.norm(p, axis=-1) - radius, radius
    half = 0.5 * _number(prim, "height", time)
    if prim.IsA(UsdGeom.Capsule):

        def capsule(p: Floats) -> Floats:
            along = np.maximum(np.abs(p[..., 2]) - half, 0.0)
            return np.asarray(np.hypot(np.hypot(p[..., 0], p[..., 1]), along) - radius)

        return capsule, radius + half
    top = 0.0 if prim.IsA(UsdGeom.Cone) else radius

    def frustum(p: Floats) -> Floats:
        out, z = np.hypot(p[..., 0], p[..., 1]), p[..., 2]
        wall = radius + (top - radius) * (z + half) / (2.0 * half)
        return np.asarray(np.maximum(np.abs(z) - half, out - wall))

    return frustum, max(radius, half)


def _volume(prim: Usd.Prim, time: Usd.TimeCode) -> float:
    if prim.IsA(UsdGeom.Cube):
        return _number(prim, "size", time) ** 3
    radius = _number(prim, "radius", time)
    ball = 4.0 / 3.0 * np.pi * radius**3
    if prim.IsA(UsdGeom.Sphere):
        return ball
    barrel = np.pi * radius**2 * _number(prim, "height", time)
    if prim.IsA(UsdGeom.Capsule):
        return barrel + ball
    return barrel / 3.0 if prim.IsA(UsdGeom.Cone) else barrel
