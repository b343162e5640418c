"""Normals of faces, points and corners, computed from the geometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.usd.topology import Attribute, Topology, area_vectors, sum_by

CREASE = 30.0
"""Degrees between a face and the mean at its point beyond which the point is sharp."""


def face_normals(points: NDArray[np.float64], topology: Topology) -> Attribute:
    """Unit normal of each face: the sum of its triangles' area vectors, which is Newell's normal.

    Args:
        points: float64 [P, 3], positions in any one unit.
        topology: Faces and triangles over these points.
    """
    return _of_faces(_areas(points, topology), topology)


def vertex_normals(points: NDArray[np.float64], topology: Topology) -> Attribute:
    """Unit normal of each point: the area-weighted mean of its triangles.

    Args:
        points: float64 [P, 3], positions in any one unit.
        topology: Faces and triangles over these points.
    """
    return _of_points(_areas(points, topology), topology)


def creased_normals(points: NDArray[np.float64], topology: Topology) -> Attribute:
    """Unit normals of polygons that have none: a point's mean where all its faces are within CREASE of it, else flat.

    USD leaves such polygons flat. Tessellated curves look, and compress, better with this; boxes stay flat.

    Args:
        points: float64 [P, 3], positions in any one unit.
        topology: Faces and triangles over these points.
    """
    areas = _areas(points, topology)
    flat = topology.spread(_of_faces(areas, topology), "corner")
    smooth = topology.spread(_of_points(areas, topology), "corner")
    far = np.einsum("ij,ij->i", flat, smooth) < np.cos(np.radians(CREASE))
    sharp = np.bincount(topology.corners, far, minlength=topology.points) > 0
    return Attribute(np.where(sharp[topology.corners][:, None], flat, smooth), "corner")


def _areas(points: NDArray[np.float64], topology: Topology) -> NDArray[np.float64]:
    return area_vectors(points, topology.corners[topology.triangles])


def _of_faces(areas: NDArray[np.float64], topology: Topology) -> Attribute:
    return Attribute(unit_rows(sum_by(topology.face_of_triangle, areas, len(topology.counts))), "uniform")


def _of_points(areas: NDArray[np.float64], topology: Topology) -> Attribute:
    corners = topology.corners[topology.triangles]
    sums = sum(sum_by(corners[:, i], areas, topology.points) for i in range(3))
    return Attribute(unit_rows(np.asarray(sums)), "vertex")


def unit_rows(vectors: NDArray[np.floating]) -> NDArray[np.float32]:
    """Rows scaled to unit length, float32 [n, 3]; a zero row becomes +z, so that shading stays finite.

    Args:
        vectors: [n, 3], directions of any length.
    """
    rows = np.asarray(vectors, dtype=np.float64)
    largest = np.abs(rows).max(axis=1, keepdims=True)
    rows = np.divide(rows, largest, out=np.zeros_like(rows), where=largest > 0)
    rows[largest[:, 0] == 0, 2] = 1.0
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True), dtype=np.float32)
