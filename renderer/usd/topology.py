"""Polygons to triangles, and values of any interpolation to vertices; all vectorised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Domain = Literal["constant", "uniform", "vertex", "corner"]


@dataclass(frozen=True, slots=True)
class Attribute:
    """Values on a mesh.

    Attributes:
        values: float32 [n, width]; n is 1, faces, points or corners.
        domain: What a row belongs to; `corner` is USD's faceVarying.
    """

    values: NDArray[np.float32]
    domain: Domain


@dataclass(frozen=True, slots=True)
class Topology:
    """Polygons of a mesh and their triangles.

    Attributes:
        points: Number of points.
        counts: int64 [F], corners of each face.
        corners: int64 [C], point of each corner, faces one after the other.
        triangles: int64 [T, 3], corner indices, counter-clockwise seen from outside.
        face_of_triangle: int64 [T].
    """

    points: int
    counts: NDArray[np.int64]
    corners: NDArray[np.int64]
    triangles: NDArray[np.int64]
    face_of_triangle: NDArray[np.int64]

    def rows(self, domain: Domain) -> int:
        """Number of values an attribute of that domain has."""
        sizes = {"constant": 1, "uniform": len(self.counts), "vertex": self.points, "corner": len(self.corners)}
        return sizes[domain]

    def spread(self, attribute: Attribute, target: Literal["vertex", "corner"]) -> NDArray[np.float32]:
        """The attribute at every point or every corner, float32 [points or corners, width].

        A face's or a corner's value has no place at a point: for those the target must be `corner`.
        """
        if attribute.domain == "constant":
            rows = self.rows(target)
            return np.broadcast_to(attribute.values[:1], (rows, attribute.values.shape[1]))
        if attribute.domain == target:
            return attribute.values
        if target == "vertex":
            raise ValueError(f"{attribute.domain} values cannot be kept at points")
        if attribute.domain == "uniform":
            return np.repeat(attribute.values, self.counts, axis=0)
        return attribute.values[self.corners]


def triangulate(
    points: int,
    counts: NDArray[np.int64],
    corners: NDArray[np.int64],
    *,
    left_handed: bool = False,
    holes: NDArray[np.int64] | None = None,
) -> Topology:
    """Fan triangulation of every face that has at least three corners and is not a hole.

    Args:
        points: Number of points.
        counts: int64 [F].
        corners: int64 [C], C = sum of counts, each in [0, points).
        left_handed: Whether faces wind clockwise seen from outside (USD `orientation`).
        holes: Indices of faces that are left out.

    Raises:
        ValueError: The counts do not match the corners, or a corner names no point.
    """
    if np.any(counts < 0) or int(counts.sum()) != len(corners):
        raise ValueError("faceVertexCounts do not add up to the number of faceVertexIndices")
    if len(corners) and (int(corners.min()) < 0 or int(corners.max()) >= points):
        raise ValueError("faceVertexIndices name points that do not exist")
    fans = np.maximum(counts - 2, 0)
    if holes is not None and len(holes):
        fans[holes[(holes >= 0) & (holes < len(fans))]] = 0
    face = np.repeat(np.arange(len(counts)), fans)
    first_corner = np.concatenate(([0], np.cumsum(counts)[:-1])) if len(counts) else np.zeros(0, np.int64)
    first_fan = np.cumsum(fans) - fans
    step = np.arange(len(face)) - first_fan[face]
    start = first_corner[face]
    second, third = (2, 1) if left_handed else (1, 2)
    triangles = np.stack((start, start + step + second, start + step + third), axis=1)
    return Topology(points, counts, corners, triangles.astype(np.int64), face)
