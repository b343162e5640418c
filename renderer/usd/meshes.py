"""Meshes and gprims as one kind of shape: points, topology, normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.gprims import gprim_surface
from renderer.usd.primvars import PrimvarReader, as_rows
from renderer.usd.stage import WarningLog
from renderer.usd.topology import Attribute, Topology, triangulate
from schemas.problem import ExitCode, Problem

CREASE = 30.0
"""Degrees between a face and the mean at its point beyond which the point is sharp."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A surface in its prim's own space.

    Attributes:
        points: float64 [P, 3], stage units.
        topology: Its polygons.
        normals: Unit normals; domain `uniform` (flat), `vertex`, `constant` or `corner`.
        primvars: Reads further attributes of the same mesh.
    """

    points: NDArray[np.float64]
    topology: Topology
    normals: Attribute
    primvars: PrimvarReader


def read_shape(prim: Usd.Prim, time: Usd.TimeCode, log: WarningLog) -> Shape | None:
    """The shape of a Mesh or of an implicit gprim; None, with a warning, where there is nothing to draw.

    Raises:
        Problem: A point is NaN or infinite.
    """
    if prim.IsA(UsdGeom.Mesh):
        return _mesh_shape(prim, time, log)
    surface = gprim_surface(prim, time)
    if surface is None:
        log.add(f"{prim.GetTypeName()} prims are not drawn", prim.GetPath())
        return None
    _check_finite(surface.points, prim)
    topology = triangulate(len(surface.points), surface.counts, surface.corners)
    reader = PrimvarReader(prim, topology, time, log)
    return Shape(surface.points, topology, surface.normals, reader)


def _mesh_shape(prim: Usd.Prim, time: Usd.TimeCode, log: WarningLog) -> Shape | None:
    mesh = UsdGeom.Mesh(prim)
    points = _floats(mesh.GetPointsAttr().Get(time))
    counts = _integers(mesh.GetFaceVertexCountsAttr().Get(time))
    corners = _integers(mesh.GetFaceVertexIndicesAttr().Get(time))
    if not len(points) or not len(corners):
        log.add("the mesh is empty", prim.GetPath())
        return None
    _check_finite(points, prim)
    left_handed = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
    holes = _integers(mesh.GetHoleIndicesAttr().Get(time))
    try:
        topology = triangulate(len(points), counts, corners, left_handed=left_handed, holes=holes)
    except ValueError as error:
        log.add(f"the mesh is left out, its {error}", prim.GetPath())
        return None
    reader = PrimvarReader(prim, topology, time, log)
    smooth = mesh.GetSubdivisionSchemeAttr().Get(time) != UsdGeom.Tokens.none
    authored = None if smooth else _authored_normals(mesh, reader)
    return Shape(points, topology, _complete(authored, points, topology, smooth), reader)


def _authored_normals(mesh: UsdGeom.Mesh, reader: PrimvarReader) -> Attribute | None:
    """`primvars:normals`, else `normals`; USD ignores both on subdivision surfaces."""
    own = UsdGeom.PrimvarsAPI(mesh.GetPrim()).GetPrimvar("normals")
    if own and own.HasAuthoredValue():
        return reader.read("normals", 3)
    values = mesh.GetNormalsAttr().Get(reader.time)
    if values is None or len(values) == 0:
        return None
    return reader.fit("normals", values, str(mesh.GetNormalsInterpolation()), 3)


def _complete(authored: Attribute | None, points: NDArray[np.float64], topology: Topology, smooth: bool) -> Attribute:
    """Authored normals with zero ones replaced, else computed ones: smooth on cages, creased on polygons."""
    if authored is None:
        return vertex_normals(points, topology) if smooth else creased_normals(points, topology)
    lengths = np.linalg.norm(authored.values, axis=1)
    if not np.any(lengths < 1e-8):
        return Attribute(unit_rows(authored.values), authored.domain)
    computed = topology.spread(face_normals(points, topology), "corner")
    given = topology.spread(authored, "corner")
    bad = np.linalg.norm(given, axis=1) < 1e-8
    return Attribute(unit_rows(np.where(bad[:, None], computed, given)), "corner")


def _area_vectors(points: NDArray[np.float64], topology: Topology) -> NDArray[np.float64]:
    """Twice the area times the normal of each triangle, float64 [T, 3]."""
    a, b, c = (points[topology.corners[topology.triangles[:, i]]] for i in range(3))
    return np.cross(b - a, c - a)


def _sum_by(keys: NDArray[np.int64], vectors: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    return np.stack([np.bincount(keys, vectors[:, axis], minlength=size) for axis in range(3)], axis=1)


def face_normals(points: NDArray[np.float64], topology: Topology) -> Attribute:
    """Unit normal of each face: the sum of its triangles' area vectors, which is Newell's normal."""
    sums = _sum_by(topology.face_of_triangle, _area_vectors(points, topology), len(topology.counts))
    return Attribute(unit_rows(sums), "uniform")


def vertex_normals(points: NDArray[np.float64], topology: Topology) -> Attribute:
    """Unit normal of each point: the area-weighted mean of its triangles."""
    area = _area_vectors(points, topology)
    corners = topology.corners[topology.triangles]
    sums = _sum_by(corners.ravel(), np.repeat(area, 3, axis=0), topology.points)
    return Attribute(unit_rows(sums), "vertex")


def creased_normals(points: NDArray[np.float64], topology: Topology) -> Attribute:
    """Unit normals of polygons that have none: a point's mean where all its faces are within CREASE of it, else flat.

    USD leaves such polygons flat. Tessellated curves look, and compress, better with this; boxes stay flat.
    """
    flat = topology.spread(face_normals(points, topology), "corner")
    smooth = topology.spread(vertex_normals(points, topology), "corner")
    far = np.einsum("ij,ij->i", flat, smooth) < np.cos(np.radians(CREASE))
    sharp = np.bincount(topology.corners, far, minlength=topology.points) > 0
    return Attribute(np.where(sharp[topology.corners][:, None], flat, smooth), "corner")


def unit_rows(vectors: NDArray[np.floating]) -> NDArray[np.float32]:
    """Rows scaled to unit length, float32 [n, 3]; a zero row becomes +z, so that shading stays finite."""
    rows = np.asarray(vectors, dtype=np.float64)
    largest = np.abs(rows).max(axis=1, keepdims=True)
    rows = np.divide(rows, largest, out=np.zeros_like(rows), where=largest > 0)
    rows[largest[:, 0] == 0, 2] = 1.0
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True), dtype=np.float32)


def _floats(values: object) -> NDArray[np.float64]:
    rows = None if values is None else as_rows(values, 3)
    with np.errstate(invalid="ignore"):
        return np.zeros((0, 3)) if rows is None else rows.astype(np.float64)


def _integers(values: object) -> NDArray[np.int64]:
    return np.zeros(0, np.int64) if values is None else np.asarray(values, dtype=np.int64)


def _check_finite(points: NDArray[np.float64], prim: Usd.Prim) -> None:
    bad = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
    if bad:
        raise Problem(
            f"{bad} of the points of {prim.GetPath()} are NaN or infinite.",
            "Repair that mesh, or deactivate the prim.",
            ExitCode.USAGE,
        )
