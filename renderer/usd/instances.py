"""What is drawn, and where: traversal with native instances, point instancers, purposes and visibility."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Sdf, Usd, UsdGeom, UsdLux, UsdSkel

from renderer.usd.native import Likeness
from renderer.usd.shape import integers
from renderer.usd.skel import EVERYTHING, Skin, Skins
from renderer.usd.stage import WarningLog
from renderer.usd.transforms import Transforms
from schemas.problem import ExitCode, Problem

DRAWN_PURPOSES = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)
STAND_INS = (UsdGeom.Tokens.bounds, UsdGeom.Tokens.origin, UsdGeom.Tokens.cards)
"""Draw modes that would show something else instead of a model."""
INVISIBLE = (UsdGeom.Gprim, UsdGeom.PointInstancer, UsdSkel.Root, UsdSkel.Skeleton)
"""Kinds with an extent that are drawn for other purposes only, are followed, or show nothing by themselves."""
MAX_COPIES = 5_000_000
"""Copies of one prim by instancing: 128 bytes each."""
DEFINED = Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)
"""What is on the stage itself."""


@dataclass(frozen=True, slots=True)
class Draw:
    """A prim and where its copies stand.

    Attributes:
        prim: A gprim, maybe an instance proxy.
        matrices: float64 [M, 4, 4], row-vector convention (`p' = p @ M`), to stage space.
        skin: How a skeleton or blend shapes deform it, or None.
    """

    prim: Usd.Prim
    matrices: NDArray[np.float64]
    skin: Skin | None = None


class Walker:
    """Finds what is drawn at one time.

    Args:
        time: The time to read at.
        log: Gets a line for every prim that cannot be followed.
    """

    def __init__(self, time: Usd.TimeCode, log: WarningLog) -> None:
        self._time = time
        self._log = log
        self._transforms = Transforms(time, log)
        self._skins: Skins | None = None
        self._likeness = Likeness()
        self._kinds: dict[str, bool] = {}
        self._alike: dict[Hashable, list[Usd.Prim]] = {}

    def draws(self, stage: Usd.Stage) -> list[Draw]:
        """Every visible gprim of the stage: first what is there once, then what native instances repeat."""
        self._skins = Skins(stage, self._time, self._log)
        self._alike.clear()
        single = list(self._under(stage.GetPseudoRoot(), None, DEFINED, ()))
        return [*single, *(draw for roots in self._alike.values() for draw in self._repeated(roots))]

    def _repeated(self, roots: list[Usd.Prim]) -> Iterator[Draw]:
        """What is in native instances that look the same, from the first of them."""
        places = np.stack([self._matrix(root, None) for root in roots])
        for draw in self._under(roots[0], roots[0], DEFINED, ()):
            yield Draw(draw.prim, _combine(draw.matrices, places, draw.prim), draw.skin)

    def _under(
        self, root: Usd.Prim, relative_to: Usd.Prim | None, predicate: object, parents: tuple[Sdf.Path, ...]
    ) -> Iterator[Draw]:
        prims = iter(Usd.PrimRange(root, predicate))
        for prim in prims:
            imageable = UsdGeom.Imageable(prim)
            if not imageable:
                self._check_known(prim)
                continue
            if imageable.GetVisibilityAttr().Get(self._time) == UsdGeom.Tokens.invisible:
                prims.PruneChildren()
                continue
            key = self._likeness.key(prim) if relative_to is None and prim.IsInstance() else None
            if key is not None:
                prims.PruneChildren()
                self._alike.setdefault(key, []).append(prim)
                continue
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                if imageable.ComputePurpose() in DRAWN_PURPOSES:
                    yield from self._instanced(UsdGeom.PointInstancer(prim), relative_to, parents)
            elif prim.IsA(UsdGeom.Gprim) and imageable.ComputePurpose() in DRAWN_PURPOSES:
                yield self._draw(prim, relative_to)
            else:
                self._check_drawn(prim)

    def _draw(self, prim: Usd.Prim, relative_to: Usd.Prim | None) -> Draw:
        skin = self._skins.of(prim) if self._skins else None
        anchor = skin.anchor if skin is not None else None
        if anchor is None:
            return Draw(prim, self._matrix(prim, relative_to)[None], skin)
        if relative_to is not None and not anchor.GetPath().HasPrefix(relative_to.GetPath()):
            self._log.add("its skeleton is outside of its prototype, it keeps its bind pose", prim.GetPath())
            return Draw(prim, self._matrix(prim, relative_to)[None])
        return Draw(prim, self._matrix(anchor, relative_to)[None], skin)

    def _check_drawn(self, prim: Usd.Prim) -> None:
        """Says what of a prim that is no gprim the picture lacks."""
        mode = prim.GetAttribute(UsdGeom.Tokens.modelDrawMode) if prim.IsModel() else None
        if mode and mode.Get() in STAND_INS:
            self._log.add("model:drawMode is not used, the model itself is drawn", prim.GetPath())
        if prim.HasAPI(UsdLux.LightAPI):
            self._log.add("lights are not used, every scene is lit alike", prim.GetPath())
        elif prim.IsA(UsdGeom.Boundable) and not any(prim.IsA(kind) for kind in INVISIBLE):
            self._log.add(f"{prim.GetTypeName()} prims are not drawn", prim.GetPath())

    def _check_known(self, prim: Usd.Prim) -> None:
        """Says that a prim's type is none of this USD: whether it would show is not known."""
        kind = str(prim.GetTypeName())
        if kind and kind not in self._kinds:
            self._kinds[kind] = Usd.SchemaRegistry().FindConcretePrimDefinition(kind) is not None
        if kind and not self._kinds[kind]:
            self._log.add(f"prims of the unknown type {kind} are not drawn", prim.GetPath())

    def _matrix(self, prim: Usd.Prim, relative_to: Usd.Prim | None) -> NDArray[np.float64]:
        if relative_to is None:
            return self._transforms.to_world(prim)
        return self._transforms.to_ancestor(prim, relative_to)

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
        matrices = product(local, self._matrix(instancer.GetPrim(), relative_to))
        for primvar in UsdGeom.PrimvarsAPI(instancer).GetPrimvarsWithAuthoredValues():
            # Those with a colon in their names are some renderer's own.
            if primvar.GetInterpolation() != UsdGeom.Tokens.constant and ":" not in primvar.GetPrimvarName():
                self._log.add(f"primvar {primvar.GetPrimvarName()} of single instances is not used", path)
        if np.any((which < 0) | (which >= len(instancer.GetPrototypesRel().GetForwardedTargets()))):
            self._log.add("instances of prototypes that do not exist are left out", path)
        for index, target in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            prototype = instancer.GetPrim().GetStage().GetPrimAtPath(target)
            copies = matrices[which == index]
            if not prototype:
                self._log.add("a prototype is missing", target)
            elif len(copies):
                # Prototypes may be `over`s, so that they are not drawn where they stand.
                copies = product(self._transforms.own(prototype), copies)
                for draw in self._under(prototype, prototype, EVERYTHING, (*parents, path)):
                    yield Draw(draw.prim, _combine(draw.matrices, copies, draw.prim), draw.skin)

    def _placements(self, instancer: UsdGeom.PointInstancer) -> tuple[NDArray[np.int64], NDArray[np.float64]] | None:
        """Prototype index [M] and matrix [M, 4, 4] of every instance that is not masked.

        The prototypes' own transforms are not in them: with those USD gives up where one index is wrong.
        """
        which = integers(instancer.GetProtoIndicesAttr().Get(self._time))
        count = len(which)
        if count == 0:
            self._log.add("the point instancer has no instances", instancer.GetPath())
            return None
        matrices = instancer.ComputeInstanceTransformsAtTime(
            self._time, self._time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
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
            f"Instancing makes {len(inner) * len(outer)} copies of {prim.GetPath()}, more than {MAX_COPIES}.",
            "Split the scene.",
            ExitCode.LIMIT,
        )
    return product(inner[None], outer[:, None]).reshape(-1, 4, 4)


def product(first: NDArray[np.float64], then: NDArray[np.float64]) -> NDArray[np.float64]:
    """One transform after the other; what is not finite stays so, for the bounds to find.

    Args:
        first: float64 [..., 4, 4], the transforms that are applied first, to row vectors.
        then: float64 [..., 4, 4], those that follow.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(first @ then)
