"""Polygons to triangles, and values of any interpolation to vertices; all vectorised."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from renderer.usd.ears import clip_ears

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
    places: NDArray[np.float64] | None = None,
) -> Topology:
    """Triangles of every face that has at least three corners and is not a hole: fans, as Hydra makes them.

    Args:
        points: Number of points.
        counts: int64 [F].
        corners: int64 [C], C = sum of counts, each in [0, points).
        left_handed: Whether faces wind clockwise seen from outside (USD `orientation`).
        holes: Indices of faces that are left out.
        places: float64 [points, 3], where the points are; with them, concave faces whose fan would reach outside the
            face are cut into ears instead.

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
    triangles = np.stack((start, start + step + 1, start + step + 2), axis=1).astype(np.int64)
    if places is not None:
        folded = np.flatnonzero(_folded(places, corners, triangles, face, fans))
        triangles = clip_ears(places, corners, triangles, first_corner[folded], counts[folded], first_fan[folded])
    if left_handed:
        triangles = triangles[:, [0, 2, 1]]
    return Topology(points, counts, corners, triangles, face)


def _folded(
    places: NDArray[np.float64],
    corners: NDArray[np.int64],
    triangles: NDArray[np.int64],
    face: NDArray[np.int64],
    fans: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Which faces have a triangle in their fan that is turned against the face, bool [F]."""
    several = np.flatnonzero(fans[face] > 1)
    owner = face[several]
    area = area_vectors(places, corners[triangles[several]])
    whole = sum_by(owner, area, len(fans))
    along = np.einsum("ij,ij->i", area, whole[owner])
    # What a face warps by is no fold; neither is rounding.
    against = along < -1e-6 * np.einsum("ij,ij->i", whole, whole)[owner]
    return np.asarray(np.bincount(owner, against, minlength=len(fans)) > 0)


def area_vectors(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Twice the area times the normal of each triangle of points, float64 [T, 3].

    Args:
        points: float64 [P, 3], positions in any one unit; the result is in its square.
        triangles: int64 [T, 3], indices of points.
    """
    a = points[triangles[:, 0]]
    u, v = points[triangles[:, 1]] - a, points[triangles[:, 2]] - a
    # Written out: numpy's own cross product takes three times as long.
    columns = [u[:, i - 2] * v[:, i - 1] - u[:, i - 1] * v[:, i - 2] for i in range(3)]
    return np.stack(columns, axis=1)


def sum_by(keys: NDArray[np.int64], vectors: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Sums of the rows with the same key, float64 [size, 3].

    Args:
        keys: int64 [R], from 0 to `size` - 1.
        vectors: float64 [R, 3], the rows.
        size: Number of sums.
    """
    return np.stack([np.bincount(keys, vectors[:, axis], minlength=size) for axis in range(3)], axis=1)
