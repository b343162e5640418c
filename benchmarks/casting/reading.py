"""A second reader of stages: slow and plain, through the high-level API of UsdGeom, sharing no code with the loader."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSkel, Vt

Floats = NDArray[np.float64]

_SHOWN = (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


@dataclass(slots=True)
class Reading:
    """What a stage shows.

    Attributes:
        triangles: float64 [T, 3, 3], metres, stage axes; wound counter-clockwise seen from outside. Fans of all faces
            but those in `folded`.
        folded: Faces whose fan would reach outside them, so that they can be cut in several right ways: corners,
            float64 [n, 3] each.
        degenerate: Triangles without area, left out of `triangles`.
        gprims: Implicit surfaces: the prim and its matrix to metres (float64 [4, 4], `p' = p @ M`).
        others: The same for prims whose surface this reader does not know (curves, points, patches).
    """

    triangles: Floats
    degenerate: int
    folded: list[Floats] = field(default_factory=list)
    gprims: list[tuple[Usd.Prim, Floats]] = field(default_factory=list)
    others: list[tuple[Usd.Prim, Floats]] = field(default_factory=list)


@dataclass(slots=True)
class _Faces:
    triangles: Floats
    folded: list[Floats]


@dataclass(slots=True)
class _Found:
    prim: Usd.Prim
    matrix: Floats


class StageReading:
    """Reads a stage at the time that is rendered by default: the start of its range.

    Args:
        path: A USD file.
        variants: `/prim:set=choice` each.
    """

    def __init__(self, path: Path, variants: tuple[str, ...] = ()) -> None:
        self.stage = Usd.Stage.Open(str(path))
        self.stage.SetEditTarget(self.stage.GetSessionLayer())
        for selection in variants:
            prim, _, choice = selection.rpartition(":")
            self.stage.GetPrimAtPath(prim).GetVariantSet(choice.split("=")[0]).SetVariantSelection(choice.split("=")[1])
        ranged = self.stage.HasAuthoredTimeCodeRange()
        self.time = Usd.TimeCode(self.stage.GetStartTimeCode()) if ranged else Usd.TimeCode.EarliestTime()
        self.metres = UsdGeom.GetStageMetersPerUnit(self.stage)

    def read(self) -> Reading:
        """Everything that is shown."""
        self._bake_skins()
        reading = Reading(np.zeros((0, 3, 3)), 0)
        local: dict[Sdf.Path, _Faces] = {}
        parts: list[Floats] = []
        for found in self._stage_prims():
            prim = found.prim.GetPrimInPrototype() if found.prim.IsInstanceProxy() else found.prim
            matrix = found.matrix @ np.diag([self.metres, self.metres, self.metres, 1.0])
            if not prim.IsA(UsdGeom.Mesh):
                self._note(found.prim, matrix, reading)
                continue
            if prim.GetPath() not in local:
                local[prim.GetPath()] = self._mesh(UsdGeom.Mesh(prim))
            faces = local[prim.GetPath()]
            flat = ~np.any(_areas(faces.triangles), axis=1)
            reading.degenerate += int(flat.sum())
            parts.append(_placed(faces.triangles[~flat], matrix))
            reading.folded += [_placed(polygon[None], matrix)[0] for polygon in faces.folded]
        if parts:
            reading.triangles = np.concatenate(parts)
        return reading

    def _note(self, prim: Usd.Prim, matrix: Floats, reading: Reading) -> None:
        kinds = (UsdGeom.Cube, UsdGeom.Sphere, UsdGeom.Plane, UsdGeom.Cone, UsdGeom.Cylinder, UsdGeom.Capsule)
        known = any(prim.IsA(kind) for kind in kinds)
        (reading.gprims if known else reading.others).append((prim, matrix))

    def _bake_skins(self) -> None:
        """UsdSkel's own baking, into the session layer: points as plain points."""
        if self.time.IsEarliestTime():
            return
        now = Gf.Interval(self.time.GetValue())
        for prim in self.stage.Traverse():
            if prim.IsA(UsdSkel.Root):
                UsdSkel.BakeSkinning(UsdSkel.Root(prim), now)

    def _stage_prims(self) -> Iterator[_Found]:
        prims = iter(Usd.PrimRange.Stage(self.stage, Usd.TraverseInstanceProxies()))
        for prim in prims:
            image = UsdGeom.Imageable(prim)
            if not image:
                continue
            shown = image.ComputeVisibility(self.time) != UsdGeom.Tokens.invisible and image.ComputePurpose() in _SHOWN
            if prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                if shown:
                    world = np.array(image.ComputeLocalToWorldTransform(self.time))
                    yield from self._instances(UsdGeom.PointInstancer(prim), world)
            elif shown and prim.IsA(UsdGeom.Gprim):
                yield _Found(prim, np.array(image.ComputeLocalToWorldTransform(self.time)))

    def _instances(self, instancer: UsdGeom.PointInstancer, world: Floats) -> Iterator[_Found]:
        """Prims of every instance; `world` is where the instancer stands."""
        which = instancer.GetProtoIndicesAttr().Get(self.time) or []
        where = instancer.ComputeInstanceTransformsAtTime(
            self.time, self.time, UsdGeom.PointInstancer.ExcludeProtoXform, UsdGeom.PointInstancer.IgnoreMask
        )
        mask = instancer.ComputeMaskAtTime(self.time) or [True] * len(which)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        content = [list(self._prototype(self.stage.GetPrimAtPath(target))) for target in targets]
        for index, matrix, shown in zip(which, where, mask, strict=True):
            for found in content[index] if shown else ():
                yield _Found(found.prim, found.matrix @ np.array(matrix) @ world)

    def _prototype(self, root: Usd.Prim) -> Iterator[_Found]:
        """Prims of a prototype, relative to its parent; visibility counts from its root on."""
        above = np.linalg.inv(np.array(UsdGeom.Imageable(root).ComputeParentToWorldTransform(self.time)))
        prims = iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)))
        for prim in prims:
            image = UsdGeom.Imageable(prim)
            if image and image.GetVisibilityAttr().Get(self.time) == UsdGeom.Tokens.invisible:
                prims.PruneChildren()
            elif prim.IsA(UsdGeom.PointInstancer):
                prims.PruneChildren()
                local = np.array(image.ComputeLocalToWorldTransform(self.time)) @ above
                yield from self._instances(UsdGeom.PointInstancer(prim), local)
            elif prim.IsA(UsdGeom.Gprim) and image.ComputePurpose() in _SHOWN:
                yield _Found(prim, np.array(image.ComputeLocalToWorldTransform(self.time)) @ above)

    def _mesh(self, mesh: UsdGeom.Mesh) -> _Faces:
        """The faces of a mesh, stage units."""
        points = mesh.GetPointsAttr().Get(self.time)
        counts = mesh.GetFaceVertexCountsAttr().Get(self.time)
        indices = mesh.GetFaceVertexIndicesAttr().Get(self.time)
        # A stage may give an attribute another type than the schema's, and indices of points that do not exist.
        if not isinstance(points, (Vt.Vec3fArray, Vt.Vec3dArray, Vt.Vec3hArray)) or not counts or not indices:
            return _Faces(np.zeros((0, 3, 3)), [])
        if sum(counts) != len(indices) or max(indices) >= len(points) or min(indices) < 0:
            return _Faces(np.zeros((0, 3, 3)), [])
        solid = np.ones(len(counts), dtype=bool)
        solid[list(mesh.GetHoleIndicesAttr().Get(self.time) or [])] = False
        turned = mesh.GetOrientationAttr().Get(self.time) == UsdGeom.Tokens.leftHanded
        return _fans(np.asarray(points, dtype=np.float64)[np.array(indices)], np.array(counts), solid, turned)


def _fans(corners: Floats, counts: NDArray[np.int64], solid: NDArray[np.bool_], turned: bool) -> _Faces:
    """Faces as fans, one number of corners after the other.

    Args:
        corners: float64 [C, 3], of all faces one after the other.
        counts: int64 [F].
        solid: bool [F], which are no holes.
        turned: Whether they wind clockwise seen from outside.
    """
    first = np.cumsum(counts) - counts
    fans, folded = [np.zeros((0, 3, 3))], []
    for size in np.unique(counts[solid & (counts >= 3)]):
        rings = corners[first[solid & (counts == size)][:, None] + np.arange(size)]
        # The first corner stays the first: it decides how a fan cuts.
        rings = np.roll(rings[:, ::-1], 1, axis=1) if turned else rings
        cut = np.stack([rings[:, [0, k, k + 1]] for k in range(1, size - 1)], axis=1)
        area = _areas(cut)
        folds = np.any((area * area.sum(axis=1, keepdims=True)).sum(axis=2) < 0.0, axis=1)
        fans.append(cut[~folds].reshape(-1, 3, 3))
        folded += list(rings[folds])
    return _Faces(np.concatenate(fans), folded)


def _areas(triangles: Floats) -> Floats:
    """Twice the area times the normal, float64 [..., 3]."""
    return np.cross(triangles[..., 1, :] - triangles[..., 0, :], triangles[..., 2, :] - triangles[..., 0, :])


def _placed(rings: Floats, matrix: Floats) -> Floats:
    """Rings of corners [n, k, 3] under `p' = p @ M`; what a mirror turns round is turned back."""
    placed: Floats = rings @ matrix[:3, :3] + matrix[3, :3]
    return placed[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0.0 else placed
