"""UsdGeomBasisCurves as tubes and ribbons.

UsdGeomBasisCurves ("Tubes and Ribbons"): curves with widths alone are tubes, with widths and normals they are ribbons
that face along their normals. Hydra draws tubes as strips that turn to the camera; here a scene is loaded once for all
its views, so they are tubes in fact, of few sides. Their sides are as far out as makes the perimeter that of the
circle, and so the mean width of the silhouette that of the curve (Cauchy). A tube has a front and a back: a transparent
one is crossed twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.frames import tangents, transported
from renderer.usd.normals import unit_rows
from renderer.usd.primvars import PrimvarReader
from renderer.usd.shape import Reading, Shape, floats, integers
from renderer.usd.spline import Samples, Spline, sample, split
from renderer.usd.topology import Attribute, triangulate
from renderer.usd.widths import read_widths

DETAILS = ((8, 16), (8, 8), (4, 6), (2, 4), (1, 3))
"""Steps along each cubic segment and sides around it, finest first."""
BUDGET = 2_000_000
"""Triangles of one prim: the finest detail that keeps to it is used."""

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Strip:
    """Polygons swept along curves.

    Attributes:
        points: float64 [V, 3].
        normals: float64 [V, 3].
        sample: int64 [V], the sample of the curve that each point belongs to.
        counts: int64 [F].
        corners: int64 [C].
        curve: int64 [F], the curve that each face belongs to.
    """

    points: Floats
    normals: Floats
    sample: Integers
    counts: Integers
    corners: Integers
    curve: Integers


@dataclass(frozen=True, slots=True)
class CurveLayout:
    """Primvars of curves at their samples, and from there at the vertices (see primvars.Layout).

    Attributes:
        spline: The curves.
        samples: Where they are sampled.
        vertex_sample: int64 [V], the sample of each vertex; None: values stay at the samples.
    """

    spline: Spline
    samples: Samples
    vertex_sample: Integers | None = None

    def sizes(self) -> dict[str, int]:
        """See Layout."""
        varying = self.spline.varying
        curves = len(self.spline.counts)
        sizes = {"constant": 1, "uniform": curves, "varying": varying, "vertex": self.spline.points}
        return {**sizes, "faceVarying": varying}

    def carry(self, values: NDArray[np.float32], interpolation: str) -> Attribute:
        """See Layout.

        Args:
            values: float32 [n, width], one row for each element that `interpolation` counts.
            interpolation: Of the primvar, as USD names it: `constant`, `uniform`, `varying`, `vertex` or `faceVarying`.
        """
        if interpolation == "constant":
            return Attribute(values, "constant")
        if interpolation == "uniform":
            rows = values[self.samples.curve]
        elif interpolation == "vertex":
            rows = self.samples.vertex(values.astype(np.float64)).astype(np.float32)
        else:
            rows = self.samples.varying(values.astype(np.float64)).astype(np.float32)
        return Attribute(rows if self.vertex_sample is None else rows[self.vertex_sample], "vertex")


def curves_shape(prim: Usd.Prim, reading: Reading) -> Shape | None:
    """Tubes, or ribbons where normals are authored; None, with a warning, where there is nothing to draw.

    Raises:
        Problem: A point is NaN or infinite.
    """
    curves, time, log = UsdGeom.BasisCurves(prim), reading.time, reading.log
    points = floats(curves.GetPointsAttr().Get(time))
    counts = integers(curves.GetCurveVertexCountsAttr().Get(time))
    if not len(points) or np.any(counts < 0) or int(counts.sum()) != len(points):
        log.add("the curves are left out, curveVertexCounts do not add up to the number of points", prim.GetPath())
        return None
    points = reading.posed(points, prim)
    tokens = (curves.GetTypeAttr().Get(time), curves.GetBasisAttr().Get(time), curves.GetWrapAttr().Get(time))
    try:
        spline = split(counts, *map(str, tokens))
    except ValueError as error:
        log.add(f"the curves are left out, {error}", prim.GetPath())
        return None
    if spline.short:
        log.add("curves with too few points are left out", prim.GetPath())
    if not len(spline.segments):
        return None
    steps, sides = detail(spline)
    samples = sample(spline, steps)
    along = PrimvarReader(prim, CurveLayout(spline, samples), time, log)
    centres = samples.vertex(points)
    widths = np.broadcast_to(
        read_widths(curves.GetWidthsAttr(), str(curves.GetWidthsInterpolation()), along, points), (len(centres), 1)
    )
    facing = _authored_normals(curves, along)
    if facing is None:
        strip = tube(samples, centres, widths, sides)
    else:
        strip = ribbon(samples, centres, widths, np.broadcast_to(facing, centres.shape))
    topology = triangulate(len(strip.points), strip.counts, strip.corners)
    reader = PrimvarReader(prim, CurveLayout(spline, samples, strip.sample), time, log)
    normals = Attribute(unit_rows(strip.normals), "vertex")
    return Shape(strip.points, topology, normals, reader, len(counts), strip.curve)


def detail(spline: Spline) -> tuple[int, int]:
    """Steps along each segment and sides around it: the finest of DETAILS that keeps to BUDGET, else the coarsest."""
    for steps, sides in DETAILS:
        steps = steps if spline.cubic else 1
        if 2 * steps * sides * len(spline.segments) <= BUDGET:
            break
    return steps, sides


def _authored_normals(curves: UsdGeom.BasisCurves, along: PrimvarReader) -> Floats | None:
    """`primvars:normals`, else `normals`, at every sample or one for all; None if there are none."""
    own = UsdGeom.PrimvarsAPI(curves.GetPrim()).GetPrimvar("normals")
    if own and own.HasAuthoredValue():
        found = along.read("normals", 3)
    else:
        values = curves.GetNormalsAttr().Get(along.time)
        interpolation = str(curves.GetNormalsInterpolation())
        found = None if values is None else along.fit("normals", values, interpolation, 3)
    return None if found is None else found.values.astype(np.float64)


def tube(samples: Samples, centres: Floats, widths: Floats, sides: int) -> Strip:
    """Round tubes, closed by flat caps where a curve has ends.

    Args:
        samples: Where the curves are sampled.
        centres: float64 [M, 3], the samples.
        widths: float64 [M, 1], diameters.
        sides: At least 3.
    """
    ahead = tangents(samples, centres)
    normal = transported(samples, centres, ahead)
    binormal = np.cross(ahead, normal)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    out = np.cos(angle)[None, :, None] * normal[:, None] + np.sin(angle)[None, :, None] * binormal[:, None]
    radius = 0.5 * widths[:, None] * np.pi / (sides * np.sin(np.pi / sides))
    rings = centres[:, None] + radius * out
    around = np.arange(sides)
    a, b = samples.links[:, 0][:, None] * sides, samples.links[:, 1][:, None] * sides
    after = (around + 1) % sides
    quads = np.stack((a + around, a + after, b + after, b + around), axis=2).reshape(-1, 4)
    first, last = samples.ends[:, 0], samples.ends[:, 1]
    caps = np.concatenate((first, last))
    base = len(rings) * sides + sides * np.arange(len(caps))[:, None]
    order = np.where(np.arange(len(caps))[:, None] < len(first), around[::-1], around)
    return Strip(
        np.concatenate((rings.reshape(-1, 3), rings[caps].reshape(-1, 3))),
        np.concatenate((out.reshape(-1, 3), np.repeat(np.concatenate((-ahead[first], ahead[last])), sides, axis=0))),
        np.concatenate((np.repeat(np.arange(len(centres)), sides), np.repeat(caps, sides))),
        np.concatenate((np.full(len(quads), 4, np.int64), np.full(len(caps), sides, np.int64))),
        np.concatenate((quads.ravel(), (base + order).ravel())),
        np.concatenate((np.repeat(samples.curve[samples.links[:, 0]], sides), samples.curve[caps])),
    )


def ribbon(samples: Samples, centres: Floats, widths: Floats, facing: Floats) -> Strip:
    """Flat ribbons that face along the part of `facing` (float64 [M, 3]) across the curve; others as in `tube`."""
    ahead = tangents(samples, centres)
    across = np.cross(ahead, facing)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    # A normal along the curve says nothing: the twist-free frame decides.
    free = np.cross(ahead, transported(samples, centres, ahead))
    across = np.where(length > 1e-12, across / np.where(length > 1e-12, length, 1.0), free)
    half = 0.5 * widths * across
    points = np.stack((centres - half, centres + half), axis=1).reshape(-1, 3)
    a, b = 2 * samples.links[:, 0], 2 * samples.links[:, 1]
    quads = np.stack((a, a + 1, b + 1, b), axis=1)
    return Strip(
        points,
        np.repeat(np.cross(across, ahead), 2, axis=0),
        np.repeat(np.arange(len(centres)), 2),
        np.full(len(quads), 4, np.int64),
        quads.ravel(),
        samples.curve[samples.links[:, 0]],
    )
