"""Any drawable prim as a shape."""

from __future__ import annotations

from dataclasses import replace

from pxr import Usd, UsdGeom

from renderer.usd.curves import curves_shape
from renderer.usd.gprims import gprim_surface
from renderer.usd.meshes import mesh_shape
from renderer.usd.normals import creased_normals, unit_rows
from renderer.usd.points import points_shape
from renderer.usd.primvars import MeshLayout, PrimvarReader
from renderer.usd.shape import Reading, Shape
from renderer.usd.topology import Attribute, triangulate


def read_shape(prim: Usd.Prim, reading: Reading) -> Shape | None:
    """The shape of a Mesh, of BasisCurves, of Points or of an implicit gprim.

    None, with a warning, where there is nothing to draw or the type is none of these (NURBS, Hermite curves, volumes).

    Raises:
        Problem: A point is NaN or infinite, or there would be too many faces.
    """
    if prim.IsA(UsdGeom.Mesh):
        return mesh_shape(prim, reading)
    if prim.IsA(UsdGeom.BasisCurves):
        return curves_shape(prim, reading)
    if prim.IsA(UsdGeom.Points):
        return points_shape(prim, reading)
    try:
        surface = gprim_surface(prim, reading.time)
    except ValueError as error:
        reading.log.add(f"the prim is left out, {error}", prim.GetPath())
        return None
    if surface is None:
        reading.log.add(f"{prim.GetTypeName()} prims are not drawn", prim.GetPath())
        return None
    topology = triangulate(len(surface.points), surface.counts, surface.corners)
    reader = PrimvarReader(prim, MeshLayout(topology), reading.time, reading.log)
    points, normals = reading.posed(surface.points, prim), surface.normals
    shape = Shape(points, topology, normals, reader, len(surface.counts))
    posed = normals if reading.skin is None else reading.skin.normals(normals, topology)
    if posed is None:
        return replace(shape, normals=creased_normals(points, topology))
    return replace(shape, normals=Attribute(unit_rows(posed.values), posed.domain))
