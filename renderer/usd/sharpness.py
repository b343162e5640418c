"""Edges of a mesh, and how sharp they and its points are, from one level of subdivision to the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

INFINITE = 10.0
"""OpenSubdiv's sharpness from which an edge or a corner stays sharp at every level."""

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Cage:
    """A mesh and its subdivision attributes, by their names in UsdGeomMesh.

    Attributes:
        points: Number of points.
        counts: int64 [F], corners of each face.
        corners: int64 [C], point of each corner.
        holes: Faces that shape their neighbours but are not drawn.
        boundary: `interpolateBoundary`: none, edgeOnly or edgeAndCorner.
        creases: Points along all creases, one after the other.
        crease_lengths: Points of each crease.
        crease_sharpnesses: float64, one for each crease or one for each of its edges.
        corner_points: Points that are sharp.
        corner_sharpnesses: float64, their sharpness.
    """

    points: int
    counts: Integers
    corners: Integers
    holes: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    boundary: str = "edgeAndCorner"
    creases: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    crease_lengths: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    crease_sharpnesses: Floats = field(default_factory=lambda: np.zeros(0))
    corner_points: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    corner_sharpnesses: Floats = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, slots=True)
class Edges:
    """The edges of a mesh.

    Attributes:
        points: Number of points.
        low: int64 [E], the end with the smaller number.
        high: int64 [E], the other one.
        faces: int64 [E], how many faces meet there.
        of_corner: int64 [C], the edge from each corner to the next one of its face.
        next: int64 [C], the next corner of the same face.
        previous: int64 [C], the one before.
    """

    points: int
    low: Integers
    high: Integers
    faces: Integers
    of_corner: Integers
    next: Integers
    previous: Integers

    @staticmethod
    def of_faces(points: int, counts: Integers, corners: Integers) -> Edges:
        """The edges of faces: counts int64 [F], corners int64 [C]."""
        last = np.cumsum(counts) - 1
        first = last - counts + 1
        here = np.arange(len(corners))
        after, before = here + 1, here - 1
        after[last], before[first] = first, last
        a, b = corners, corners[after]
        keys = np.minimum(a, b) * points + np.maximum(a, b)
        unique, of_corner = np.unique(keys, return_inverse=True)
        faces = np.bincount(of_corner, minlength=len(unique))
        return Edges(points, unique // points, unique % points, faces, of_corner.ravel(), after, before)

    def find(self, a: Integers, b: Integers) -> Integers:
        """The edge between each two points; -1 where there is none."""
        keys = np.minimum(a, b) * self.points + np.maximum(a, b)
        own = self.low * self.points + self.high
        at = np.minimum(np.searchsorted(own, keys), max(len(own) - 1, 0))
        return np.where(own[at] == keys, at, -1) if len(own) else np.full(len(keys), -1)


@dataclass(frozen=True, slots=True)
class Sharpness:
    """How sharp edges and points are; boundaries are infinitely sharp.

    Attributes:
        edges: The edges.
        of_edges: float64 [E].
        of_points: float64 [P].
        uninterpolated: bool [F], the cage's faces at a boundary that `interpolateBoundary = none` leaves undrawn;
            empty on finer levels.
    """

    edges: Edges
    of_edges: Floats
    of_points: Floats
    uninterpolated: NDArray[np.bool_]

    @staticmethod
    def of_cage(cage: Cage, counts: Integers, corners: Integers) -> Sharpness:
        """What a cage's attributes say, for the faces of it that have an area."""
        edges = Edges.of_faces(cage.points, counts, corners)
        authored = _authored_creases(cage, edges)
        border = edges.faces != 2
        of_edges = np.where(border, np.inf, authored)
        of_points = _authored_corners(cage)
        ends = np.concatenate((edges.low, edges.high))
        edge_count = np.bincount(ends, minlength=cage.points)
        face_count = np.bincount(corners, minlength=cage.points)
        # A point inside has as many edges as faces, one on a border one more; others are no manifold, or in no face.
        strange = (edge_count - face_count > 1) | (edge_count < face_count) | (face_count == 0)
        of_points = np.where(strange, np.inf, of_points)
        outside = np.bincount(ends, np.tile(border, 2), minlength=cage.points) > 0
        if cage.boundary == "edgeAndCorner":
            of_points = np.where(outside & (face_count == 1), np.inf, of_points)
        uninterpolated = np.zeros(len(counts), dtype=bool)
        if cage.boundary == "none":
            open_edges = np.tile(border & (authored < INFINITE), 2)
            loose = np.bincount(ends, open_edges, minlength=cage.points) > 0
            face = np.repeat(np.arange(len(counts)), counts)
            uninterpolated = np.bincount(face, loose[corners], minlength=len(counts)) > 0
        return Sharpness(edges, of_edges, of_points, uninterpolated)

    def of_child_edges(self) -> Floats:
        """Sharpness of the halves of each edge, one level finer, float64 [E]."""
        return np.maximum(self.of_edges - 1.0, 0.0)

    def of_child_points(self) -> Floats:
        """Sharpness of each point, one level finer, float64 [P]."""
        return np.maximum(self.of_points - 1.0, 0.0)

    def refined(self, fine: Edges) -> Sharpness:
        """The sharpness on the edges of the next level: halves of edges keep one less, all others are smooth."""
        old = self.edges
        middle = old.points + np.arange(len(old.low))
        of_edges = np.zeros(len(fine.low))
        for end in (old.low, old.high):
            of_edges[fine.find(end, middle)] = self.of_child_edges()
        of_points = np.zeros(fine.points)
        of_points[: old.points] = self.of_child_points()
        return Sharpness(fine, of_edges, of_points, np.zeros(0, dtype=bool))


class RuleWeights(NamedTuple):
    """Share of one rule in each new point: through its rule at the coarse level and that at the fine one."""

    parent: Floats
    child: Floats

    @property
    def total(self) -> Floats:
        """float64 [P]."""
        return self.parent + self.child


def split_weights(sharp: Sharpness) -> tuple[RuleWeights, RuleWeights, RuleWeights]:
    """Shares of the rules smooth, crease and corner in each point (DeRose et al. 1998, as OpenSubdiv blends them).

    A point with fewer than two sharp edges is smooth, with two on a crease, with more, or itself sharp, a corner.
    """
    coarse = _rule(sharp.edges, sharp.of_edges, sharp.of_points)
    fine = _rule(sharp.edges, sharp.of_child_edges(), sharp.of_child_points())
    share = np.where(coarse == fine, 1.0, _ending(sharp))
    result = [RuleWeights(share * (coarse == rule), (1.0 - share) * (fine == rule)) for rule in range(3)]
    return result[0], result[1], result[2]


def _rule(edges: Edges, of_edges: Floats, of_points: Floats) -> Integers:
    on = of_edges > 0.0
    meeting = np.bincount(np.concatenate((edges.low[on], edges.high[on])), minlength=edges.points)
    rule = np.where(meeting < 2, 0, np.where(meeting == 2, 1, 2))
    return np.where(of_points > 0.0, 2, rule)


def _ending(sharp: Sharpness) -> Floats:
    """Mean of the sharpnesses around a point that are above 0 and end in this level, at most 1, float64 [P]."""
    ending = (sharp.of_edges > 0.0) & (sharp.of_edges <= 1.0)
    ends = np.concatenate((sharp.edges.low[ending], sharp.edges.high[ending]))
    total = np.bincount(ends, np.tile(sharp.of_edges[ending], 2), minlength=sharp.edges.points).astype(np.float64)
    number = np.bincount(ends, minlength=sharp.edges.points).astype(np.float64)
    own = (sharp.of_points > 0.0) & (sharp.of_points <= 1.0)
    total += np.where(own, sharp.of_points, 0.0)
    number += own
    return np.divide(total, number, out=np.zeros_like(total), where=number > 0.0)


def _authored_creases(cage: Cage, edges: Edges) -> Floats:
    """Sharpness of each edge from creaseIndices, creaseLengths and creaseSharpnesses, float64 [E]."""
    result = np.zeros(len(edges.low))
    lengths, sharpnesses = cage.crease_lengths, cage.crease_sharpnesses
    if not len(lengths) or np.any(lengths < 0) or int(lengths.sum()) != len(cage.creases):
        return result
    steps = np.maximum(lengths - 1, 0)
    if len(sharpnesses) == len(lengths):
        sharpnesses = np.repeat(sharpnesses, steps)
    if len(sharpnesses) != int(steps.sum()):
        return result
    inside = np.ones(len(cage.creases), dtype=bool)
    inside[np.cumsum(lengths)[lengths > 0] - 1] = False
    start = np.flatnonzero(inside)
    edge = edges.find(cage.creases[start], cage.creases[start + 1])
    found = edge >= 0
    np.maximum.at(result, edge[found], _clean(sharpnesses[found]))
    return result


def _authored_corners(cage: Cage) -> Floats:
    result = np.zeros(cage.points)
    at = cage.corner_points
    if len(at) == len(cage.corner_sharpnesses):
        good = (at >= 0) & (at < cage.points)
        np.maximum.at(result, at[good], _clean(cage.corner_sharpnesses[good]))
    return result


def _clean(sharpnesses: Floats) -> Floats:
    """Sharpnesses that can be counted down: not negative, infinite from INFINITE on."""
    known = np.nan_to_num(sharpnesses, nan=0.0, posinf=np.inf)
    return np.where(known >= INFINITE, np.inf, np.maximum(known, 0.0))
