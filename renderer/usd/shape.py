"""What any kind of prim is turned into, and what reading one needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from renderer.usd.primvars import PrimvarReader, as_rows
from renderer.usd.skel import Skin
from renderer.usd.stage import WarningLog
from renderer.usd.topology import Attribute, Topology
from schemas.problem import ExitCode, Problem


@dataclass(frozen=True, slots=True)
class Shape:
    """A surface in its prim's own space; a skinned one in that of its skeleton.

    Attributes:
        points: float64 [P, 3], stage units.
        topology: Its polygons.
        normals: Unit normals; domain `uniform` (flat), `vertex`, `constant` or `corner`.
        primvars: Reads further attributes of the same surface.
        elements: How many authored faces, curves or points it has, which GeomSubsets name.
        element_of_face: int64 [F], the authored element that each polygon comes from; None: polygons are the elements.
    """

    points: NDArray[np.float64]
    topology: Topology
    normals: Attribute
    primvars: PrimvarReader
    elements: int
    element_of_face: NDArray[np.int64] | None = None

    @property
    def element_of_triangle(self) -> NDArray[np.int64]:
        """The authored element of each triangle, int64 [T]."""
        face = self.topology.face_of_triangle
        return face if self.element_of_face is None else self.element_of_face[face]


@dataclass(frozen=True, slots=True)
class Reading:
    """How a prim is read.

    Attributes:
        time: The time code of every attribute.
        log: Gets a line for everything that cannot be drawn as it is authored.
        refine: Levels of subdivision of meshes that have a subdivision scheme.
        skin: How the prim is deformed, or None.
    """

    time: Usd.TimeCode
    log: WarningLog
    refine: int = 0
    skin: Skin | None = None

    def posed(self, points: NDArray[np.float64], prim: Usd.Prim) -> NDArray[np.float64]:
        """Points as the skin deforms them, float64 [P, 3].

        Args:
            points: float64 [P, 3], positions at rest, in the prim's own space.
            prim: Prim that the points belong to, for the message.

        Raises:
            Problem: One is NaN or infinite.
        """
        check_finite(points, prim)
        if self.skin is None:
            return points
        moved = self.skin.points(points)
        check_finite(moved, prim)
        return moved


def floats(values: object) -> NDArray[np.float64]:
    """A list of vectors as float64 [n, 3]; empty if it is absent or of another shape."""
    rows = None if values is None else as_rows(values, 3)
    with np.errstate(invalid="ignore"):
        return np.zeros((0, 3)) if rows is None else rows.astype(np.float64)


def integers(values: object) -> NDArray[np.int64]:
    """A list of whole numbers as int64 [n]; empty if it is absent or of another type."""
    array = np.asarray(values)
    return array.astype(np.int64).reshape(-1) if array.dtype.kind in "iu" else np.zeros(0, np.int64)


def check_finite(points: NDArray[np.float64], prim: Usd.Prim) -> None:
    """Raises Problem if a point is NaN or infinite.

    Args:
        points: float64 [P, 3], positions.
        prim: Prim that the points belong to, for the message.
    """
    bad = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
    if bad:
        raise Problem(
            f"{bad} of the points of {prim.GetPath()} are NaN or infinite.",
            "Repair that mesh, or deactivate the prim.",
            ExitCode.USAGE,
        )
