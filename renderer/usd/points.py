"""UsdGeomPoints as small solids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.normals import unit_rows
from renderer.usd.primvars import PrimvarReader
from renderer.usd.shape import Reading, Shape, floats
from renderer.usd.topology import Attribute, triangulate
from renderer.usd.widths import read_widths

MANY = 100_000
"""Points from which on each is an octahedron instead of an icosahedron."""


@dataclass(frozen=True, slots=True)
class Solid:
    """A body round the origin: points float64 [V, 3] of unit length, triangles int64 [T, 3], scale for its points.

    The scale gives it the surface of the unit sphere, and so, for a convex body, its mean silhouette (Cauchy).
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    scale: float


@dataclass(frozen=True, slots=True)
class PointsLayout:
    """Primvars of points, each drawn with `size` vertices (see primvars.Layout)."""

    count: int
    size: int

    def sizes(self) -> dict[str, int]:
        """See Layout."""
        return {"constant": 1, "uniform": self.count, "varying": self.count, "vertex": self.count}

    def carry(self, values: NDArray[np.float32], interpolation: str) -> Attribute:
        """See Layout.

        Args:
            values: float32 [n, width], one row for each element that `interpolation` counts.
            interpolation: Of the primvar, as USD names it: `constant`, `uniform`, `varying`, `vertex` or `faceVarying`.
        """
        if interpolation == "constant":
            return Attribute(values, "constant")
        return Attribute(np.repeat(values, self.size, axis=0), "vertex")


def points_shape(prim: Usd.Prim, reading: Reading) -> Shape | None:
    """Points as spheres of their widths, each a solid of few triangles; None, with a warning, if there are none.

    Authored normals, which would make discs of them, are not used.

    Raises:
        Problem: A point is NaN or infinite.
    """
    cloud = UsdGeom.Points(prim)
    points = floats(cloud.GetPointsAttr().Get(reading.time))
    if not len(points):
        reading.log.add("the points are empty", prim.GetPath())
        return None
    points = reading.posed(points, prim)
    solid = octahedron() if len(points) > MANY else icosahedron()
    reader = PrimvarReader(prim, PointsLayout(len(points), len(solid.points)), reading.time, reading.log)
    # Widths come for each vertex of each solid.
    widths = read_widths(cloud.GetWidthsAttr(), str(cloud.GetWidthsInterpolation()), reader, points)
    out = np.tile(solid.points, (len(points), 1))
    places = np.repeat(points, len(solid.points), axis=0) + 0.5 * solid.scale * widths * out
    triangles = solid.triangles[None] + len(solid.points) * np.arange(len(points))[:, None, None]
    counts = np.full(len(points) * len(solid.triangles), 3, np.int64)
    topology = triangulate(len(places), counts, triangles.ravel())
    element = np.repeat(np.arange(len(points)), len(solid.triangles))
    return Shape(places, topology, Attribute(unit_rows(out), "vertex"), reader, len(points), element)


def octahedron() -> Solid:
    """Eight triangles."""
    points = np.concatenate((np.eye(3), -np.eye(3)))
    top = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2]])
    return _solid(points, np.concatenate((top, np.where(top == 2, 5, top)[:, ::-1])))


def icosahedron() -> Solid:
    """Twenty triangles."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    signs = [(a, b) for a in (-1.0, 1.0) for b in (-golden, golden)]
    points = np.array([np.roll((0.0, a, b), shift) for shift in range(3) for a, b in signs])
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = np.isclose(distance, 2.0)
    faces = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    return _solid(points, np.array(faces))


def _solid(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> Solid:
    unit = points / np.linalg.norm(points, axis=1, keepdims=True)
    a, b, c = (unit[triangles[:, i]] for i in range(3))
    area = np.cross(b - a, c - a)
    inward = np.einsum("ij,ij->i", area, a) < 0.0
    outward = np.where(inward[:, None], triangles[:, ::-1], triangles).astype(np.int64)
    return Solid(unit, outward, float(np.sqrt(4.0 * np.pi / (0.5 * np.linalg.norm(area, axis=1).sum()))))
