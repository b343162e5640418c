"""Tessellation of USD's implicit gprims: Cube, Sphere, Cylinder, Cone, Capsule, Plane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.drivers import floats_of
from renderer.usd.topology import Attribute

AROUND = 32
"""Segments around an axis."""
ALONG = 16
"""Segments from pole to pole of a sphere."""
AXES = ("X", "Y", "Z")
HUGE = 1e30
"""A measure beyond this cannot be drawn."""


@dataclass(frozen=True, slots=True)
class Surface:
    """Polygons of a gprim: points float64 [P, 3], counts int64 [F], corners int64 [C], unit normals."""

    points: NDArray[np.float64]
    counts: NDArray[np.int64]
    corners: NDArray[np.int64]
    normals: Attribute


def gprim_surface(prim: Usd.Prim, time: Usd.TimeCode) -> Surface | None:
    """The polygons of an implicit gprim in its own space; None if the type is not one of those above.

    Raises:
        ValueError: One of its measures is no number of a sensible size, or its axis is none.
    """

    def number(name: str) -> float:
        found = floats_of(prim.GetAttribute(name).Get(time), 1)
        if found is None or abs(found[0]) > HUGE:
            raise ValueError(f"its {name} is no number that can be used")
        return found[0]

    def axis() -> str:
        found = str(prim.GetAttribute("axis").Get(time))
        if found not in AXES:
            raise ValueError(f"its axis {found} is none of {', '.join(AXES)}")
        return found

    if prim.IsA(UsdGeom.Cube):
        return _cube(number("size"))
    if prim.IsA(UsdGeom.Plane):
        return _plane(number("width"), number("length"), axis())
    if prim.IsA(UsdGeom.Sphere):
        return _lathe(_arc(number("radius"), 0.0, -90.0, 90.0, ALONG), "Z")
    profile = _axial_profile(prim, number)
    return None if profile is None else _lathe(profile, axis())


Profile = list[tuple[NDArray[np.float64], NDArray[np.float64]]]
"""Pieces from bottom to top, each (radius, height) [n, 2] and its normals [n, 2]; pieces meet at sharp edges."""


def _axial_profile(prim: Usd.Prim, number: Callable[[str], float]) -> Profile | None:
    if prim.IsA(UsdGeom.Cone):
        return _frustum(number("radius"), 0.0, number("height"))
    if prim.IsA(UsdGeom.Cylinder):
        return _frustum(number("radius"), number("radius"), number("height"))
    if prim.IsA(UsdGeom.Cylinder_1):
        return _frustum(number("radiusBottom"), number("radiusTop"), number("height"))
    if prim.IsA(UsdGeom.Capsule):
        return _capsule(number("radius"), number("radius"), number("height"))
    if prim.IsA(UsdGeom.Capsule_1):
        return _capsule(number("radiusBottom"), number("radiusTop"), number("height"))
    return None


def _frustum(bottom: float, top: float, height: float) -> Profile:
    half = 0.5 * height
    slope = _unit2(np.array([height, bottom - top]))
    side = (np.array([[bottom, -half], [top, half]]), np.array([slope, slope]))
    down, up = np.array([[0.0, -1.0]] * 2), np.array([[0.0, 1.0]] * 2)
    pieces = [(np.array([[0.0, -half], [bottom, -half]]), down), side, (np.array([[top, half], [0.0, half]]), up)]
    return [piece for piece in pieces if np.any(piece[0][:, 0] > 0.0)]


def _capsule(bottom: float, top: float, height: float) -> Profile:
    half = 0.5 * height
    low, high = _arc(bottom, -half, -90.0, 0.0, ALONG // 2)[0], _arc(top, half, 0.0, 90.0, ALONG // 2)[0]
    return [(np.concatenate((low[0], high[0])), np.concatenate((low[1], high[1])))]


def _arc(radius: float, centre: float, start: float, stop: float, steps: int) -> Profile:
    """Part of a circle round (0, centre), degrees from the equator."""
    angle = np.radians(np.linspace(start, stop, steps + 1))
    # The cosine of 90 degrees is not 0 in floating point; the poles have to be.
    direction = np.stack((np.where(np.abs(np.abs(angle) - np.pi / 2) < 1e-9, 0.0, np.cos(angle)), np.sin(angle)), 1)
    return [(radius * direction + np.array([0.0, centre]), direction)]


def _lathe(profile: Profile, axis: str) -> Surface:
    """Turns a profile around an axis; quads, whose collapsed halves at the poles are dropped as degenerate later."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    around = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    points: list[NDArray[np.float64]] = []
    normals: list[NDArray[np.float64]] = []
    quads: list[NDArray[np.int64]] = []
    first = 0
    for line, slope in profile:
        for rows, out in ((line, points), (slope, normals)):
            ring = rows[:, None, :1] * around[None]
            out.append(
                np.concatenate((ring, np.broadcast_to(rows[:, None, 1:], (*ring.shape[:2], 1))), 2).reshape(-1, 3)
            )
        low = first + np.arange(len(line) - 1)[:, None] * AROUND + np.arange(AROUND)
        next_low = first + np.arange(len(line) - 1)[:, None] * AROUND + (np.arange(AROUND) + 1) % AROUND
        quads.append(np.stack((low, next_low, next_low + AROUND, low + AROUND), axis=2).reshape(-1, 4))
        first += len(line) * AROUND
    corners = np.concatenate(quads)
    order = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}[axis]
    return Surface(
        np.concatenate(points)[:, order],
        np.full(len(corners), 4, np.int64),
        corners.ravel().astype(np.int64),
        Attribute(np.concatenate(normals)[:, order].astype(np.float32), "vertex"),
    )


def _cube(size: float) -> Surface:
    half = 0.5 * size
    points = np.array([[x, y, z] for z in (-half, half) for y in (-half, half) for x in (-half, half)])
    faces = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    normals = np.array([[0, 0, -1], [0, 0, 1], [0, -1, 0], [0, 1, 0], [-1, 0, 0], [1, 0, 0]], dtype=np.float32)
    return Surface(points, np.full(6, 4, np.int64), faces.ravel().astype(np.int64), Attribute(normals, "uniform"))


def _plane(width: float, length: float, axis: str) -> Surface:
    """Width and length lie along x and y for axis Z, z and y for X, x and z for Y (UsdGeomPlane)."""
    w, h = 0.5 * width, 0.5 * length
    flat = np.array([[-w, -h], [w, -h], [w, h], [-w, h]])
    zero = np.zeros(4)
    columns = {
        "X": (zero, flat[:, 1], -flat[:, 0]),
        "Y": (flat[:, 0], zero, -flat[:, 1]),
        "Z": (flat[:, 0], flat[:, 1], zero),
    }[axis]
    normal = np.eye(3, dtype=np.float32)["XYZ".index(axis)][None]
    corners = np.arange(4, dtype=np.int64)
    return Surface(np.stack(columns, axis=1), np.array([4]), corners, Attribute(normal, "constant"))


def _unit2(v: NDArray[np.float64]) -> NDArray[np.float64]:
    length = float(np.hypot(v[0], v[1]))
    return v / length if length > 0.0 else np.array([1.0, 0.0])
