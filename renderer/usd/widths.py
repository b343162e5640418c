"""Widths of curves and points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.primvars import PrimvarReader

THIN = 1.0 / 500.0
"""Width of what has none, as a share of the diagonal of its prim."""


def read_widths(
    attribute: Usd.Attribute, interpolation: str, reader: PrimvarReader, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """`primvars:widths`, else `widths`, else something thin: float64 [n, 1], a row for each vertex, or one for all.

    USD gives curves and points without widths no size at all ("wires"): a renderer's line or dot has the width of a
    pixel, which geometry for any camera cannot have.

    Args:
        attribute: `widths` of the prim.
        interpolation: Its interpolation.
        reader: The prim's primvars.
        points: float64 [P, 3], the prim's points, whose extent decides what is thin.
    """
    own = UsdGeom.PrimvarsAPI(reader.prim).GetPrimvar("widths")
    if own and own.HasAuthoredValue():
        found = reader.read("widths", 1)
    else:
        values = attribute.Get(reader.time)
        found = None if values is None else reader.fit("widths", values, interpolation, 1)
    if found is not None:
        return np.abs(found.values.astype(np.float64))
    reader.log.add("there are no widths, it is drawn thin", reader.prim.GetPath())
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    return np.array([[THIN * diagonal if diagonal > 0.0 else 1.0]])
