"""Batches of curves: their segments, and points on them (UsdGeomBasisCurves, "Segment Indexing" and what follows)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

BASES = {
    "bezier": np.array([[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], dtype=np.float64),
    "bspline": np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]], dtype=np.float64) / 6.0,
    "catmullRom": np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]], dtype=np.float64) / 2.0,
    "linear": np.array([[1, 0, 0, 0], [-1, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]], dtype=np.float64),
}
"""Weights of a segment's four vertices, a row for each power of the parameter; linear ones have two vertices."""


@dataclass(frozen=True, slots=True)
class Spline:
    """Curves as segments.

    Attributes:
        basis: A key of BASES.
        closed: Whether curves end where they begin.
        counts: int64 [N], vertices of each curve.
        points: Vertices of all curves.
        phantoms: int64 [n, 2], vertices (a, b) for each phantom vertex 2 a - b; they are numbered from `points`.
        segments: int64 [S, 4], vertices of each segment, curve by curve.
        knots: int64 [S, 2], varying values at its begin and end.
        curve: int64 [S], the curve of each segment.
        varying: Number of varying values.
        short: How many curves have too few vertices for a segment.
    """

    basis: str
    closed: bool
    counts: Integers
    points: int
    phantoms: Integers
    segments: Integers
    knots: Integers
    curve: Integers
    varying: int
    short: int

    @property
    def cubic(self) -> bool:
        """Whether segments are curved."""
        return self.basis != "linear"


@dataclass(frozen=True, slots=True)
class Samples:
    """Places on curves, in order along each.

    Attributes:
        spline: The curves.
        segment: int64 [M].
        at: float64 [M], parameter in its segment, 0 to 1.
        curve: int64 [M].
        links: int64 [L, 2], samples that follow each other, also from the last to the first of closed curves.
        ends: int64 [n, 2], first and last sample of each curve that is not closed.
        first: int64 [n], first sample of each curve that has segments.
    """

    spline: Spline
    segment: Integers
    at: Floats
    curve: Integers
    links: Integers
    ends: Integers
    first: Integers

    def vertex(self, values: Floats) -> Floats:
        """Values of vertices, float64 [points, width], by the basis at every sample [M, width]."""
        a, b = self.spline.phantoms.T
        values = np.concatenate((values, 2.0 * values[a] - values[b]))
        weights = np.vander(self.at, 4, increasing=True) @ BASES[self.spline.basis]
        return np.asarray(np.einsum("mk,mkw->mw", weights, values[self.spline.segments[self.segment]]))

    def varying(self, values: Floats) -> Floats:
        """Varying values, float64 [varying, width], linear in each segment, at every sample [M, width]."""
        begin, end = self.spline.knots[self.segment].T
        at = self.at[:, None]
        return np.asarray((1.0 - at) * values[begin] + at * values[end])


def split(counts: Integers, kind: str, basis: str, wrap: str) -> Spline:
    """The segments of curves.

    Args:
        counts: int64 [N], vertices of each curve.
        kind: `type`: linear or cubic.
        basis: bezier, bspline or catmullRom; nothing for linear curves.
        wrap: nonperiodic, periodic or pinned.

    Raises:
        ValueError: One of the names is not known.
    """
    if kind not in ("linear", "cubic") or (kind == "cubic" and basis not in BASES):
        raise ValueError(f"their type {kind} or basis {basis} is not known")
    if wrap not in ("nonperiodic", "periodic", "pinned"):
        raise ValueError(f"their wrap {wrap} is not known")
    basis = "linear" if kind == "linear" else basis
    closed = wrap == "periodic"
    pinned = wrap == "pinned" and basis in ("bspline", "catmullRom")
    step, reach = (3, 4) if basis == "bezier" else (1, 2 if kind == "linear" else 4)
    own = counts + 2 * pinned
    number = counts // step if closed else np.where(own >= reach, (own - reach) // step + 1, 0)
    # A closed curve of fewer vertices has no inside; a phantom needs a second vertex.
    number = np.where(counts >= (3 if closed else 2), number, 0)
    begin = np.cumsum(counts) - counts
    curve = np.repeat(np.arange(len(counts)), number)
    place = np.arange(len(curve)) - np.repeat(np.cumsum(number) - number, number)
    local = place[:, None] * step + np.arange(4) - pinned
    size = counts[curve][:, None]
    local = local % size if closed else np.where(local > size - (0 if pinned else 1), size - 1, local)
    points = int(counts.sum())
    segments = begin[curve][:, None] + local
    phantoms = np.zeros((0, 2), np.int64)
    if pinned:
        good = counts >= 2
        first = np.where(good, begin, 0)
        last = np.where(good, begin + counts - 1, 0)
        ends = (np.stack((first, first + good), axis=1), np.stack((last, last - good), axis=1))
        phantoms = np.concatenate(ends)
        number_of = points + np.arange(len(phantoms))
        segments = np.where(local < 0, number_of[curve][:, None], segments)
        segments = np.where(local == size, number_of[len(counts) + curve][:, None], segments)
    per_curve = number + (0 if closed else 1)
    base = (np.cumsum(per_curve) - per_curve)[curve]
    knots = np.stack((base + place, base + ((place + 1) % number[curve] if closed else place + 1)), axis=1)
    short = int(np.count_nonzero(number == 0))
    return Spline(basis, closed, counts, points, phantoms, segments, knots, curve, int(per_curve.sum()), short)


def sample(spline: Spline, steps: int) -> Samples:
    """Places at even parameters, `steps` on each segment; curves that are not closed also get one at their end."""
    number = np.bincount(spline.curve, minlength=len(spline.counts))
    number = number[number > 0]
    last = np.cumsum(number) - 1
    segments = np.arange(len(spline.segments))
    segment = np.repeat(segments, steps)
    at = np.tile(np.arange(steps) / steps, len(segments))
    sizes = number * steps
    if not spline.closed:
        behind = np.cumsum(sizes)
        segment, at = np.insert(segment, behind, last), np.insert(at, behind, 1.0)
        sizes = sizes + 1
    first = np.cumsum(sizes) - sizes
    here = np.arange(len(segment))
    final = first + sizes - 1
    after = here + 1
    after[final] = first
    links = np.stack((here, after), axis=1)
    ends = np.stack((first, final), axis=1)
    if spline.closed:
        ends = ends[:0]
    else:
        links = np.delete(links, final, axis=0)
    return Samples(spline, segment, at, spline.curve[segment], links, ends, first)
