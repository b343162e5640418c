"""Meshes: points, topology, subdivision, normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.normals import creased_normals, face_normals, unit_rows, vertex_normals
from renderer.usd.primvars import MeshLayout, PrimvarReader
from renderer.usd.refine import RefinedLayout, refine
from renderer.usd.shape import Reading, Shape, floats, integers
from renderer.usd.sharpness import Cage
from renderer.usd.topology import Attribute, Topology, triangulate


def mesh_shape(prim: Usd.Prim, reading: Reading) -> Shape | None:
    """The shape of a Mesh; None, with a warning, where there is nothing to draw.

    Raises:
        Problem: A point is NaN or infinite, or subdivision makes too many faces.
    """
    mesh, time, log = UsdGeom.Mesh(prim), reading.time, reading.log
    points = floats(mesh.GetPointsAttr().Get(time))
    counts = integers(mesh.GetFaceVertexCountsAttr().Get(time))
    corners = integers(mesh.GetFaceVertexIndicesAttr().Get(time))
    if not len(points) or not len(corners):
        log.add("the mesh is empty", prim.GetPath())
        return None
    points = reading.posed(points, prim)
    left_handed = mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded
    holes = integers(mesh.GetHoleIndicesAttr().Get(time))
    try:
        topology = triangulate(len(points), counts, corners, left_handed=left_handed, holes=holes, places=points)
    except ValueError as error:
        log.add(f"the mesh is left out, its {error}", prim.GetPath())
        return None
    scheme = str(mesh.GetSubdivisionSchemeAttr().Get(time))
    if scheme != UsdGeom.Tokens.none and reading.refine > 0:
        shape = _refined(mesh, scheme, points, topology, left_handed, reading)
        if shape is not None:
            return shape
    reader = PrimvarReader(prim, MeshLayout(topology), time, log)
    smooth = scheme != UsdGeom.Tokens.none
    authored = None if smooth else _authored_normals(mesh, reader, topology, reading)
    return Shape(points, topology, _complete(authored, points, topology, smooth), reader, len(counts))


def _refined(
    mesh: UsdGeom.Mesh,
    scheme: str,
    points: NDArray[np.float64],
    topology: Topology,
    left_handed: bool,
    reading: Reading,
) -> Shape | None:
    """The mesh after `reading.refine` levels of its scheme; None where the scheme cannot be applied to it."""
    prim, time = mesh.GetPrim(), reading.time
    cage = Cage(
        topology.points,
        topology.counts,
        topology.corners,
        holes=integers(mesh.GetHoleIndicesAttr().Get(time)),
        boundary=str(mesh.GetInterpolateBoundaryAttr().Get(time)),
        creases=integers(mesh.GetCreaseIndicesAttr().Get(time)),
        crease_lengths=integers(mesh.GetCreaseLengthsAttr().Get(time)),
        crease_sharpnesses=_numbers(mesh.GetCreaseSharpnessesAttr().Get(time)),
        corner_points=integers(mesh.GetCornerIndicesAttr().Get(time)),
        corner_sharpnesses=_numbers(mesh.GetCornerSharpnessesAttr().Get(time)),
    )
    try:
        refined = refine(cage, scheme, reading.refine)
    except ValueError as error:
        reading.log.add(f"the mesh is not refined, {error}", prim.GetPath())
        return None
    moved = refined.vertex(points)
    fine = triangulate(len(moved), refined.counts, refined.corners, left_handed=left_handed, holes=refined.holes)
    reader = PrimvarReader(prim, RefinedLayout(topology, refined), time, reading.log)
    return Shape(moved, fine, vertex_normals(moved, fine), reader, len(topology.counts), refined.parents)


def _authored_normals(
    mesh: UsdGeom.Mesh, reader: PrimvarReader, topology: Topology, reading: Reading
) -> Attribute | None:
    """`primvars:normals`, else `normals`, as the skin turns them; USD ignores both on subdivision surfaces."""
    own = UsdGeom.PrimvarsAPI(mesh.GetPrim()).GetPrimvar("normals")
    if own and own.HasAuthoredValue():
        found = reader.read("normals", 3)
    else:
        values = mesh.GetNormalsAttr().Get(reader.time)
        found = None if values is None else reader.fit("normals", values, str(mesh.GetNormalsInterpolation()), 3)
    return found if found is None or reading.skin is None else reading.skin.normals(found, topology)


def _complete(authored: Attribute | None, points: NDArray[np.float64], topology: Topology, smooth: bool) -> Attribute:
    """Authored normals with zero ones replaced, else computed ones: smooth on cages, creased on polygons."""
    if authored is None:
        return vertex_normals(points, topology) if smooth else creased_normals(points, topology)
    # In double precision: the squares of large ones are beyond float32.
    lengths = np.linalg.norm(authored.values.astype(np.float64), axis=1)
    if not np.any(lengths < 1e-8):
        return Attribute(unit_rows(authored.values), authored.domain)
    computed = topology.spread(face_normals(points, topology), "corner")
    given = topology.spread(authored, "corner")
    bad = np.linalg.norm(given.astype(np.float64), axis=1) < 1e-8
    return Attribute(unit_rows(np.where(bad[:, None], computed, given)), "corner")


def _numbers(values: object) -> NDArray[np.float64]:
    array = np.asarray(values)
    return array.astype(np.float64).reshape(-1) if array.dtype.kind in "iuf" else np.zeros(0)
