"""Geometry of the sample scenes: numpy in, polygons out; y is up, sizes in the scene's units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Polygons:
    """A mesh of quads or triangles.

    Attributes:
        points: float64 [P, 3].
        faces: int64 [F, 3 or 4], counter-clockwise seen from outside.
        st: Texture coordinates of the points, float64 [P, 2], or None.
        smooth: Whether normals are shared between faces.
    """

    points: Floats
    faces: NDArray[np.int64]
    st: Floats | None = None
    smooth: bool = True

    def moved(
        self, *, scale: float | tuple[float, float, float] = 1.0, by: tuple[float, float, float] = (0, 0, 0)
    ) -> Polygons:
        """Scaled, then moved."""
        return Polygons(self.points * np.array(scale) + np.array(by), self.faces, self.st, self.smooth)

    def turned(self, axis: int, degrees: float) -> Polygons:
        """Turned counter-clockwise about a coordinate axis."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        u, v = (axis + 1) % 3, (axis + 2) % 3
        points = self.points.copy()
        points[:, u] = c * self.points[:, u] - s * self.points[:, v]
        points[:, v] = s * self.points[:, u] + c * self.points[:, v]
        return Polygons(points, self.faces, self.st, self.smooth)


def joined(pieces: list[Polygons]) -> Polygons:
    """Meshes of the same face size as one."""
    starts = np.cumsum([0] + [len(p.points) for p in pieces[:-1]])
    st = [p.st for p in pieces if p.st is not None]
    return Polygons(
        np.concatenate([p.points for p in pieces]),
        np.concatenate([p.faces + start for p, start in zip(pieces, starts, strict=True)]),
        np.concatenate(st) if len(st) == len(pieces) else None,
        pieces[0].smooth,
    )


def grid_faces(rows: int, columns: int, *, close_rows: bool = False, close_columns: bool = False) -> NDArray[np.int64]:
    """Quads of a grid of rows x columns points, point (r, c) at r * columns + c, int64 [F, 4]."""
    r = np.arange(rows if close_rows else rows - 1)[:, None]
    c = np.arange(columns if close_columns else columns - 1)[None]
    r1, c1 = (r + 1) % rows, (c + 1) % columns
    return np.stack((r * columns + c, r * columns + c1, r1 * columns + c1, r1 * columns + c), axis=2).reshape(-1, 4)


def grid_st(rows: int, columns: int) -> Floats:
    """Texture coordinates of a grid, columns along s, float64 [rows*columns, 2]."""
    t, s = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    return np.stack((s, t), axis=2).reshape(-1, 2)


def lathe(profile: list[tuple[float, float]], around: int = 48) -> Polygons:
    """A profile of (radius, height), bottom to top outside, turned round the y axis; the seam is closed."""
    line = np.array(profile, dtype=np.float64)
    angle = -2.0 * np.pi * np.arange(around) / around
    x = line[:, :1] * np.cos(angle)
    z = line[:, :1] * np.sin(angle)
    y = np.broadcast_to(line[:, 1:], x.shape)
    return Polygons(np.stack((x, y, z), axis=2).reshape(-1, 3), grid_faces(len(line), around, close_columns=True))


def rounded(profile: list[tuple[float, float]], steps: int = 6) -> list[tuple[float, float]]:
    """A Catmull-Rom curve through the points of a profile, `steps` samples a span; radii stay >= 0."""
    p = np.array([profile[0], *profile, profile[-1]], dtype=np.float64)
    t = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None]
    spans = []
    for i in range(1, len(p) - 2):
        a, b, c, d = p[i - 1], p[i], p[i + 1], p[i + 2]
        spans.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))
    curve = np.concatenate((*spans, p[-1:]))
    return [(max(float(r), 0.0), float(h)) for r, h in curve]


def sphere(radius: float, rows: int = 24, around: int = 48) -> Polygons:
    """A sphere round the origin."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rows + 1)
    return lathe([(radius * max(float(np.cos(a)), 0.0), radius * float(np.sin(a))) for a in angle], around)


def tube(path: Floats, radius: Floats | float, around: int = 12, *, closed: bool = False) -> Polygons:
    """A tube along a path float64 [n, 3]; frames are carried along without twist, so that it does not pinch."""
    tangent = np.roll(path, -1, 0) - np.roll(path, 1, 0) if closed else np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.empty_like(path)
    start = np.eye(3)[int(np.argmin(np.abs(tangent[0])))]
    for i, t in enumerate(tangent):
        start = start - t * float(start @ t)
        start = start / np.linalg.norm(start)
        side[i] = start
    other = np.cross(tangent, side)
    if closed:
        # The carried frame comes back turned by some angle: spread that turn over the whole path.
        miss = np.arctan2(float(side[-1] @ other[0]), float(side[-1] @ side[0]))
        turn = -miss * np.arange(len(path)) / len(path)
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        side, other = c * side + s * other, c * other - s * side
    angle = 2.0 * np.pi * np.arange(around) / around
    ring = side[:, None] * np.cos(angle)[None, :, None] + other[:, None] * np.sin(angle)[None, :, None]
    width = np.broadcast_to(np.asarray(radius, dtype=np.float64).reshape(-1, 1, 1), (len(path), 1, 1))
    points = path[:, None] + ring * width
    return Polygons(points.reshape(-1, 3), grid_faces(len(path), around, close_rows=closed, close_columns=True))


def torus_knot(p: int, q: int, size: float, thickness: float, steps: int = 320, around: int = 14) -> Polygons:
    """A (p, q) torus knot."""
    t = 2.0 * np.pi * np.arange(steps) / steps
    r = 0.6 + 0.25 * np.cos(q * t)
    path = size * np.stack((r * np.cos(p * t), 0.25 * np.sin(q * t) * 1.4, r * np.sin(p * t)), axis=1)
    return tube(path, thickness, around, closed=True)


def box(size: tuple[float, float, float]) -> Polygons:
    """A box round the origin, flat-shaded."""
    x, y, z = (0.5 * s for s in size)
    corners = np.array([[i, j, k] for k in (-z, z) for j in (-y, y) for i in (-x, x)])
    faces = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    return Polygons(corners, faces, smooth=False)


def sheet(width: float, height: float, rows: int = 1, columns: int = 1) -> Polygons:
    """A grid in the x-y plane round the origin, facing +z, with texture coordinates."""
    st = grid_st(rows + 1, columns + 1)
    points = np.column_stack(((st[:, 0] - 0.5) * width, (st[:, 1] - 0.5) * height, np.zeros(len(st))))
    return Polygons(points, grid_faces(rows + 1, columns + 1), st)


def unit(vectors: Floats) -> Floats:
    """Vectors [..., 3] scaled to unit length."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def directions(count: int, rng: np.random.Generator) -> Floats:
    """Unit vectors, uniform over the sphere, float64 [count, 3]."""
    return unit(rng.normal(size=(count, 3)))


def bent_cards(centres: Floats, normals: Floats, ups: Floats, sizes: Floats, aspect: float, bend: float) -> Polygons:
    """Bent cards of 3 x 3 points each, standing on their centres."""
    base = sheet(aspect, 1.0, 2, 2)
    right = unit(np.cross(ups, normals))
    up = np.cross(normals, right)
    local = base.points + np.array([0.0, 0.5, 0.0])
    local[:, 2] = bend * (0.25 - local[:, 1] ** 2)
    frame = np.stack((right, up, normals), axis=1) * sizes[:, None, None]
    points = centres[:, None] + local[None] @ frame
    count = len(centres)
    faces = (base.faces[None] + 9 * np.arange(count)[:, None, None]).reshape(-1, 4)
    assert base.st is not None
    return Polygons(points.reshape(-1, 3), faces, np.tile(base.st, (count, 1)))


def sprites(centres: Floats, facing: Floats, sizes: Floats, rng: np.random.Generator) -> Polygons:
    """Square cards of four points each round their centres, at random turns about what they face.

    Args:
        centres: float64 [M, 3].
        facing: Unit normals, float64 [M, 3].
        sizes: Sides, float64 [M].
        rng: For the turns.
    """
    count = len(centres)
    right = unit(np.cross(facing, directions(count, rng)))
    across = 0.5 * sizes[:, None, None] * np.stack((right, np.cross(facing, right)), axis=1)
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    points = centres[:, None] + corners[None] @ across
    st = np.tile(0.5 * corners + 0.5, (count, 1))
    return Polygons(points.reshape(-1, 3), np.arange(4 * count).reshape(-1, 4), st, smooth=False)


def disc(radius: float, thickness: float, around: int = 64) -> Polygons:
    """A flat disc whose top is at height 0."""
    return lathe(
        [(0.0, -thickness), (radius, -thickness), (radius, -thickness), (radius, 0.0), (radius, 0.0), (0.0, 0.0)],
        around,
    )


def voxel_faces(filled: NDArray[np.bool_], hidden_by: NDArray[np.bool_]) -> Polygons:
    """Faces of the filled cells of a grid [X, Y, Z] that no cell of `hidden_by` touches; cells have side 1.

    Args:
        filled: bool [X, Y, Z], the cells that have faces.
        hidden_by: bool [X, Y, Z], cells that hide the faces that touch them.
    """
    unit = box((1.0, 1.0, 1.0)).moved(by=(0.5, 0.5, 0.5))
    directions = [(0, 0, -1), (0, 0, 1), (0, -1, 0), (0, 1, 0), (-1, 0, 0), (1, 0, 0)]
    around = np.pad(hidden_by, 1)
    pieces = []
    for face, (dx, dy, dz) in zip(unit.faces, directions, strict=True):
        x, y, z = filled.shape
        open_side = filled & ~around[1 + dx : 1 + dx + x, 1 + dy : 1 + dy + y, 1 + dz : 1 + dz + z]
        cells = np.argwhere(open_side)
        pieces.append((cells[:, None] + unit.points[face][None]).reshape(-1, 3))
    points = np.concatenate(pieces)
    unique, index = np.unique(points, axis=0, return_inverse=True)
    return Polygons(unique, index.reshape(-1, 4), smooth=False)
