"""What is drawn, and where: traversal with native instances, point instancers, purposes and visibility."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom

from renderer.usd.stage import WarningLog
from schemas.problem import ExitCode, Problem

DRAWN_PURPOSES = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
MAX_COPIES = 5_000_000
"""Copies of one prim by point instancers: 128 bytes each."""


@dataclass(frozen=True, slots=True)
class Draw:
    """A prim and where its copies stand.

    Attributes:
        prim: A gprim, maybe an instance proxy.
        matrices: float64 [M, 4, 4], row-vector convention (`p' = p @ M`), to stage space.
    """

    prim: Usd.Prim
    matrices: NDArray[np.float64]


class Walker:
    """Finds what is drawn at one time.

    Args:
        time: The time to read at.
        log: Gets a line for every prim that cannot be followed.
    """

    def __init__(self, time: Usd.TimeCode, log: WarningLog) -> None:
        self._time = time
        self._log = log
        self._cache = UsdGeom.XformCache(time)

    def draws(self, stage: Usd.Stage) -> list[Draw]:
        """Every visible gprim of the stage, in traversal order."""
        predicate = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
        return list(self._under(stage.GetPseudoRoot(), None, predicate, ()))

    def _under(
        self, root: Usd.Prim, relative_to: Usd.Prim | None, predicate: object, parents: tuple[Sdf.Path, ...]
    ) -> Iterator[Draw]:
        prims = iter(Usd.PrimRange(root, predicate))
        for prim in prims:
            imageable = UsdGeom.Imageable(prim)
            if not imageable:
                continue
            if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
                prims.PruneChildren()
                continue
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                if imageable.ComputePurpose() in DRAWN_PURPOSES:
                    yield from self._instanced(UsdGeom.PointInstancer(prim), relative_to, parents)
            elif prim.IsA(UsdGeom.Gprim) and imageable.ComputePurpose() in DRAWN_PURPOSES:
                yield Draw(prim, self._matrix(prim, relative_to)[None])

    def _matrix(self, prim: Usd.Prim, relative_to: Usd.Prim | None) -> NDArray[np.float64]:
        if relative_to is None:
            return np.array(self._cache.GetLocalToWorldTransform(prim), dtype=np.float64)
        return np.array(self._cache.ComputeRelativeTransform(prim, relative_to)[0], dtype=np.float64)

    def _instanced(
        self, instancer: UsdGeom.PointInstancer, relative_to: Usd.Prim | None, parents: tuple[Sdf.Path, ...]
    ) -> Iterator[Draw]:
        path = instancer.GetPath()
        if path in parents:
            self._log.add("the point instancer contains itself, left out", path)
            return
        placed = self._placements(instancer)
        if placed is None:
            return
        which, local = placed
        matrices = local @ self._matrix(instancer.GetPrim(), relative_to)
        # Prototypes may be `over`s, so that they are not drawn where they stand.
        predicate = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
        for index, target in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            prototype = instancer.GetPrim().GetStage().GetPrimAtPath(target)
            copies = matrices[which == index]
            if not prototype:
                self._log.add("a prototype is missing", target)
            elif len(copies):
                for draw in self._under(prototype, prototype, predicate, (*parents, path)):
                    yield Draw(draw.prim, _combine(draw.matrices, copies, draw.prim))

    def _placements(self, instancer: UsdGeom.PointInstancer) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
        """Prototype index [M] and matrix [M, 4, 4] of every instance that is not masked."""
        indices = instancer.GetProtoIndicesAttr().Get(self._time)
        count = len(indices) if indices is not None else 0
        if count == 0:
            self._log.add("the point instancer has no instances", instancer.GetPath())
            return None
        matrices = instancer.ComputeInstanceTransformsAtTime(
            self._time, self._time, UsdGeom.PointInstancer.IncludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        which = np.asarray(indices, dtype=np.int64)
        placed = np.asarray(matrices, dtype=np.float64).reshape(-1, 4, 4)
        if len(placed) != count:
            self._log.add("the point instancer's arrays differ in length, left out", instancer.GetPath())
            return None
        mask = np.asarray(instancer.ComputeMaskAtTime(self._time), dtype=bool)
        if len(mask) == count:
            which, placed = which[mask], placed[mask]
        return which, placed


def _combine(inner: NDArray[np.float64], outer: NDArray[np.float64], prim: Usd.Prim) -> NDArray[np.float64]:
    """All products inner @ outer, float64 [len(outer) * len(inner), 4, 4]."""
    if len(inner) * len(outer) > MAX_COPIES:
        raise Problem(
            f"Point instancers make {len(inner) * len(outer)} copies of {prim.GetPath()}, more than {MAX_COPIES}.",
            "Split the scene.",
            ExitCode.LIMIT,
        )
    return (inner[None] @ outer[:, None]).reshape(-1, 4, 4)
