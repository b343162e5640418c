"""Primvars as attributes of a surface, at every interpolation, indexed or not, inherited or not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Tf, Usd, UsdGeom

from renderer.usd.stage import WarningLog
from renderer.usd.topology import Attribute, Domain, Topology

DOMAINS: dict[str, Domain] = {
    "constant": "constant",
    "uniform": "uniform",
    "vertex": "vertex",
    "varying": "vertex",
    "faceVarying": "corner",
}


class Layout(Protocol):
    """Which values belong to what of a prim, and where they end up on its surface."""

    def sizes(self) -> dict[str, int]:
        """How many values each interpolation has."""

    def carry(self, values: NDArray[np.float32], interpolation: str) -> Attribute:
        """As many values as `sizes` says, float32 [n, width], on the surface that is drawn.

        Args:
            values: float32 [n, width], one row for each element that `interpolation` counts.
            interpolation: Of the primvar, as USD names it: `constant`, `uniform`, `varying`, `vertex` or `faceVarying`.
        """


@dataclass(frozen=True, slots=True)
class MeshLayout:
    """Values of a mesh that is drawn as it is authored."""

    topology: Topology

    def sizes(self) -> dict[str, int]:
        """See Layout."""
        return {name: self.topology.rows(domain) for name, domain in DOMAINS.items()}

    def carry(self, values: NDArray[np.float32], interpolation: str) -> Attribute:
        """See Layout.

        Args:
            values: float32 [n, width], one row for each element that `interpolation` counts.
            interpolation: Of the primvar, as USD names it: `constant`, `uniform`, `varying`, `vertex` or `faceVarying`.
        """
        return Attribute(values, DOMAINS[interpolation])


@dataclass(frozen=True, slots=True)
class PrimvarReader:
    """Reads primvars of one prim at one time.

    Attributes:
        prim: The gprim; constant primvars are inherited from its ancestors.
        layout: What the values belong to.
        time: The time to read at.
        log: Gets a line for every primvar that does not fit.
    """

    prim: Usd.Prim
    layout: Layout
    time: Usd.TimeCode
    log: WarningLog

    def read(self, name: str, width: int) -> Attribute | None:
        """The primvar `name` as float32 rows of `width` numbers; None where it is absent, empty or does not fit."""
        primvar = UsdGeom.PrimvarsAPI(self.prim).FindPrimvarWithInheritance(name)
        if not primvar or not primvar.HasValue():
            return None
        try:
            values = primvar.ComputeFlattened(self.time)
        except Tf.ErrorException:
            values = None
        if values is None:
            self.log.add(f"primvar {name} has no value that can be read", self.prim.GetPath())
            return None
        return self.fit(name, values, str(primvar.GetInterpolation()), width)

    def texture_coordinates(self) -> str | None:
        """Name of the first primvar of the prim itself that can serve as texture coordinates."""
        for primvar in UsdGeom.PrimvarsAPI(self.prim).GetPrimvarsWithValues():
            kind = primvar.GetTypeName()
            if kind in (Sdf.ValueTypeNames.TexCoord2fArray, Sdf.ValueTypeNames.Float2Array):
                return str(primvar.GetPrimvarName())
        return None

    def fit(self, name: str, values: object, interpolation: str, width: int) -> Attribute | None:
        """Raw values as an attribute; None, with a warning, where shape or length do not fit the prim."""
        rows = as_rows(values, width)
        if rows is None or len(rows) == 0:
            return None
        sizes = self.layout.sizes()
        if interpolation not in sizes:
            interpolation = "constant"
        wanted = sizes[interpolation]
        if len(rows) != wanted and interpolation == "constant":
            rows = rows[:1]
        elif len(rows) != wanted:
            self.log.add(
                f"{name} has {len(rows)} values where its interpolation {interpolation} needs {wanted}; ignored",
                self.prim.GetPath(),
            )
            return None
        if not np.all(np.isfinite(rows)):
            self.log.add(f"{name} has values that are not finite; ignored", self.prim.GetPath())
            return None
        return self.layout.carry(rows, interpolation)


def as_rows(values: object, width: int) -> NDArray[np.float32] | None:
    """A value or array of values as float32 [n, width]; None if it does not have that shape."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            array = np.asarray(values, dtype=np.float32)
    except (TypeError, ValueError):
        return None
    if array.ndim <= 1 and array.size % width == 0 and (width == 1 or array.size == width):
        return array.reshape(-1, width)
    return array if array.ndim == 2 and array.shape[1] == width else None
