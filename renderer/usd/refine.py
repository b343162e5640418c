"""Subdivision surfaces: Catmull-Clark, Loop and bilinear, uniformly refined, all vectorised.

Rules: Catmull and Clark 1978; Loop 1987; infinitely sharp and semi-sharp creases after Hoppe et al. 1994 and DeRose,
Kass and Truong 1998, with sharpness that falls by one a level; where a vertex's rule changes during a level the two
rules are blended by the mean of the sharpnesses that end in it, as OpenSubdiv does. Points are those of the refined
cage, not of the limit surface, as a rasteriser at that complexity shows them. `trianglesSubdivisionRule` is not read:
triangles follow Catmull and Clark like every other face.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.usd.primvars import MeshLayout
from renderer.usd.sharpness import Cage, Edges, Sharpness, split_weights
from renderer.usd.topology import Attribute, Topology
from schemas.problem import ExitCode, Problem

MAX_FACES = 30_000_000
"""Of one refined mesh: two triangles each, the most that a scene may have."""

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Refined:
    """A refined mesh and how values of the cage reach it.

    Attributes:
        counts: int64 [F'], corners of each face.
        corners: int64 [C'], point of each corner.
        parents: int64 [F'], the cage's face that each one is part of.
        holes: int64, faces that are not drawn.
        authored_corners: int64, the cage's corners that belong to faces with an area.
        levels: The steps from the cage.
    """

    counts: Integers
    corners: Integers
    parents: Integers
    holes: Integers
    authored_corners: Integers
    levels: tuple[Level, ...]

    def vertex(self, values: Floats) -> Floats:
        """Values of points, float64 [P, width], smoothed like the points themselves."""
        for level in self.levels:
            values = level.smooth(values)
        return values

    def varying(self, values: Floats) -> Floats:
        """Values of points, float64 [P, width], interpolated linearly along edges and within faces."""
        for level in self.levels:
            values = level.linear(values)
        return values

    def face_varying(self, values: Floats) -> Floats:
        """Values of corners, float64 [C, width], interpolated linearly within each face.

        This is `faceVaryingLinearInterpolation = all`; the other modes, which smooth inside of seams, are read as it.
        """
        values = values[self.authored_corners]
        for level in self.levels:
            values = level.corner_linear(values)
        return values


@dataclass(frozen=True, slots=True)
class RefinedLayout:
    """Primvars of a cage on its refined mesh (see primvars.Layout)."""

    cage: Topology
    refined: Refined

    def sizes(self) -> dict[str, int]:
        """See Layout."""
        return MeshLayout(self.cage).sizes()

    def carry(self, values: NDArray[np.float32], interpolation: str) -> Attribute:
        """See Layout.

        Args:
            values: float32 [n, width], one row for each element that `interpolation` counts.
            interpolation: Of the primvar, as USD names it: `constant`, `uniform`, `varying`, `vertex` or `faceVarying`.
        """
        if interpolation == "constant":
            return Attribute(values, "constant")
        if interpolation == "uniform":
            return Attribute(values[self.refined.parents], "uniform")
        wide = values.astype(np.float64)
        if interpolation == "faceVarying":
            return Attribute(self.refined.face_varying(wide).astype(np.float32), "corner")
        spread = self.refined.vertex if interpolation == "vertex" else self.refined.varying
        return Attribute(spread(wide).astype(np.float32), "vertex")


def refine(cage: Cage, scheme: str, levels: int) -> Refined:
    """Refines a cage.

    Args:
        cage: The cage; its corners are valid, faces of fewer than three corners are dropped.
        scheme: catmullClark, loop or bilinear.
        levels: How often each face is split into four (the first time: into as many as it has corners), at least 1.

    Raises:
        ValueError: The scheme is unknown, or is `loop` and a face is no triangle.
        Problem: There would be too many faces.
    """
    if scheme not in ("catmullClark", "loop", "bilinear"):
        raise ValueError(f"its subdivision scheme {scheme} is not known")
    solid = cage.counts >= 3
    if scheme == "loop" and np.any(cage.counts[solid] != 3):
        raise ValueError("its subdivision scheme loop needs triangles")
    authored_corners = np.flatnonzero(np.repeat(solid, cage.counts))
    if len(authored_corners) * 4 ** (levels - 1) > MAX_FACES:
        raise Problem(
            f"Refining by {levels} levels makes {len(authored_corners) * 4 ** (levels - 1)} faces of one mesh, more "
            f"than {MAX_FACES}.",
            "Refine less.",
            ExitCode.LIMIT,
        )
    counts, corners = cage.counts[solid], cage.corners[authored_corners]
    parents = np.flatnonzero(solid)
    sharp = Sharpness.of_cage(cage, counts, corners)
    hidden = np.isin(parents, cage.holes) | sharp.uninterpolated
    steps: list[Level] = []
    for _ in range(levels):
        step = Level(scheme, sharp, counts, corners)
        steps.append(step)
        parents, hidden = parents[step.parents], hidden[step.parents]
        counts, corners, sharp = step.counts, step.corners, step.child_sharpness()
    return Refined(counts, corners, parents, np.flatnonzero(hidden), authored_corners, tuple(steps))


class Level:
    """One step of refinement.

    New points come in the order: those of the points, of the edges, and of the faces (not for `loop`).

    Args:
        scheme: As in `refine`.
        sharp: Edges and sharpness of the coarse mesh.
        counts: int64 [F], its faces.
        corners: int64 [C], their corners.

    Attributes:
        counts: int64 [F'], faces of the finer mesh.
        corners: int64 [C'], their corners.
        parents: int64 [F'], the coarse face that each is part of.
    """

    def __init__(self, scheme: str, sharp: Sharpness, counts: Integers, corners: Integers) -> None:
        self._scheme = scheme
        self._sharp = sharp
        self._edges = sharp.edges
        self._counts = counts
        self._corners = corners
        self._face = np.repeat(np.arange(len(counts)), counts)
        if scheme == "loop":
            self.counts, self.corners, self.parents = self._triangles()
        else:
            self.counts, self.corners, self.parents = self._quads()

    def _quads(self) -> tuple[Integers, Integers, Integers]:
        edges, first_edge = self._edges, self._edges.points
        centre = first_edge + len(edges.low) + self._face
        ahead, behind = first_edge + edges.of_corner, first_edge + edges.of_corner[edges.previous]
        corners = np.stack((self._corners, ahead, centre, behind), axis=1)
        return np.full(len(corners), 4, np.int64), corners.ravel(), self._face

    def _triangles(self) -> tuple[Integers, Integers, Integers]:
        ahead = (self._edges.points + self._edges.of_corner).reshape(-1, 3)
        own = self._corners.reshape(-1, 3)
        # Three at the corners, one in the middle.
        parts = [np.stack((own[:, i], ahead[:, i], ahead[:, i - 1]), axis=1) for i in range(3)]
        corners = np.stack((*parts, ahead), axis=1).reshape(-1, 3)
        return np.full(len(corners), 3, np.int64), corners.ravel(), np.repeat(np.arange(len(own)), 4)

    def child_sharpness(self) -> Sharpness:
        """Edges and sharpness of the finer mesh."""
        fine = Edges.of_faces(self._new_points(), self.counts, self.corners)
        return self._sharp.refined(fine)

    def _new_points(self) -> int:
        faces = 0 if self._scheme == "loop" else len(self._counts)
        return self._edges.points + len(self._edges.low) + faces

    def linear(self, values: Floats) -> Floats:
        """Points stay, edges get their middle, faces their mean: float64 [P', width]."""
        middles = 0.5 * (values[self._edges.low] + values[self._edges.high])
        if self._scheme == "loop":
            return np.concatenate((values, middles))
        return np.concatenate((values, middles, self._centres(values[self._corners])))

    def corner_linear(self, values: Floats) -> Floats:
        """Values of coarse corners at the fine ones, each face by itself: float64 [C', width]."""
        edges = self._edges
        ahead = 0.5 * (values + values[edges.next])
        if self._scheme == "loop":
            own, middle = (rows.reshape(-1, 3, values.shape[1]) for rows in (values, ahead))
            parts = [np.stack((own[:, i], middle[:, i], middle[:, i - 1]), axis=1) for i in range(3)]
            return np.stack((*parts, middle), axis=1).reshape(-1, values.shape[1])
        centre = self._centres(values)[self._face]
        return np.stack((values, ahead, centre, ahead[edges.previous]), axis=1).reshape(-1, values.shape[1])

    def smooth(self, values: Floats) -> Floats:
        """The scheme's own rule: float64 [P', width]."""
        if self._scheme == "bilinear":
            return self.linear(values)
        if self._scheme == "loop":
            return np.concatenate((self._vertex_points(values, None), self._edge_points(values, None)))
        centres = self._centres(values[self._corners])
        return np.concatenate((self._vertex_points(values, centres), self._edge_points(values, centres), centres))

    def _centres(self, corner_values: Floats) -> Floats:
        return _sums(self._face, corner_values, len(self._counts)) / self._counts[:, None]

    def _edge_points(self, values: Floats, centres: Floats | None) -> Floats:
        edges = self._edges
        ends = values[edges.low] + values[edges.high]
        if centres is None:
            # Loop: 3/8 of each end, 1/8 of each opposite corner.
            opposite = _sums(edges.of_corner, values[self._corners[edges.previous]], len(ends))
            soft = 0.375 * ends + 0.125 * opposite
        else:
            around = _sums(edges.of_corner, centres[self._face], len(ends))
            soft = 0.25 * (ends + around)
        crease = np.minimum(self._sharp.of_edges, 1.0)[:, None]
        return (1.0 - crease) * soft + crease * 0.5 * ends

    def _vertex_points(self, values: Floats, centres: Floats | None) -> Floats:
        edges, size = self._edges, len(values)
        both = np.concatenate((edges.low, edges.high))
        neighbours = _sums(both, np.concatenate((values[edges.high], values[edges.low])), size)
        valence = np.bincount(both, minlength=size).astype(np.float64)[:, None]
        n = np.maximum(valence, 1.0)
        if centres is None:
            # Loop's original weights.
            beta = (0.625 - (0.375 + 0.25 * np.cos(2.0 * np.pi / n)) ** 2) / n
            soft = (1.0 - valence * beta) * values + beta * neighbours
        else:
            around = _sums(self._corners, centres[self._face], size)
            soft = ((n - 2.0) * values + (neighbours + around) / n) / n
        result = np.zeros_like(values)
        for weights, rule in zip(split_weights(self._sharp), (soft, None, values), strict=True):
            if rule is not None:
                result += weights.total[:, None] * rule
            elif np.any(weights.total > 0.0):
                result += self._creased(values, weights.parent, weights.child)
        return result

    def _creased(self, values: Floats, parent: Floats, child: Floats) -> Floats:
        """Three quarters of the point and an eighth of each neighbour along the crease, weighted."""
        edges = self._edges
        result = 0.75 * (parent + child)[:, None] * values
        for weight, crease in ((parent, self._sharp.of_edges), (child, self._sharp.of_child_edges())):
            on = crease > 0.0
            low, high = edges.low[on], edges.high[on]
            ends = np.concatenate((low, high))
            others = np.concatenate((values[high], values[low]))
            result += 0.125 * weight[:, None] * _sums(ends, others, len(values))
        return result


def _sums(keys: Integers, values: Floats, size: int) -> Floats:
    """Sums of the rows with the same key, float64 [size, width]."""
    columns = [np.bincount(keys, values[:, i], minlength=size) for i in range(values.shape[1])]
    return np.stack(columns, axis=1)
