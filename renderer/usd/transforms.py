"""Where prims stand, also those whose transform operations are damaged."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Tf, Usd, UsdGeom

from renderer.usd.stage import WarningLog, usd_reason


class Transforms:
    """Transforms of prims at one time, float64 [4, 4], row-vector convention (`p' = p @ M`).

    USD raises an error for operations that do not exist or have a value of a wrong type, whatever is asked of the
    prims below. Here such a prim stands where its parent does, with a warning.

    Args:
        time: The time to read at.
        log: Gets a line for every transform that cannot be read.
    """

    def __init__(self, time: Usd.TimeCode, log: WarningLog) -> None:
        self._time = time
        self._log = log
        self._cache = UsdGeom.XformCache(time)

    def to_world(self, prim: Usd.Prim) -> NDArray[np.float64]:
        """From a prim to the stage."""
        return self._read(lambda: self._cache.GetLocalToWorldTransform(prim), prim, None)

    def to_ancestor(self, prim: Usd.Prim, ancestor: Usd.Prim) -> NDArray[np.float64]:
        """From a prim to one above it, without that one's own transform."""
        return self._read(lambda: self._cache.ComputeRelativeTransform(prim, ancestor)[0], prim, ancestor)

    def own(self, prim: Usd.Prim) -> NDArray[np.float64]:
        """From a prim to its parent."""
        return self._read(lambda: self._cache.GetLocalTransformation(prim)[0], prim, prim.GetParent())

    def _read(
        self, compute: Callable[[], Gf.Matrix4d], prim: Usd.Prim, ancestor: Usd.Prim | None
    ) -> NDArray[np.float64]:
        try:
            return np.array(compute(), dtype=np.float64)
        except Tf.ErrorException as error:
            return self._product(prim, ancestor, usd_reason(error))

    def _product(self, prim: Usd.Prim, ancestor: Usd.Prim | None, reason: str) -> NDArray[np.float64]:
        """Prim by prim, so that only what is damaged is left out; the reason is for one that says nothing again."""
        matrix, first, named = np.eye(4), prim, False
        while prim and not prim.IsPseudoRoot() and prim != ancestor:
            xformable = UsdGeom.Xformable(prim)
            if xformable:
                try:
                    matrix = matrix @ np.array(xformable.GetLocalTransformation(self._time), dtype=np.float64)
                except Tf.ErrorException as error:
                    self._left_out(usd_reason(error), prim)
                    named = True
                if xformable.GetResetXformStack():
                    break
            prim = prim.GetParent()
        if not named:
            self._left_out(reason, first)
        return matrix

    def _left_out(self, reason: str, prim: Usd.Prim) -> None:
        self._log.add(f"a transform of the prim or above it is left out, {reason}", prim.GetPath())
