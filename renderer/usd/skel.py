"""UsdSkel at one time: blend shapes, then skinning by joints.

A skinned prim's points are `Σ w_k (p · geomBindTransform) · X_k` in the space of its skeleton, X_k the inverse bind
times the posed transform of its k-th joint (linear blend skinning; `dualQuaternion` blends rotations instead): the
prim's own transform has no part in them. UsdSkel itself does the sums, so that the pose is that of every other tool.
Blend shapes move points, in the prim's own space, before that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Sdf, Usd, UsdSkel, Vt

from renderer.usd.stage import WarningLog, canonical_path
from renderer.usd.topology import Attribute, Domain, Topology

HUGE = 1e20
"""No joint moves anything this far."""
EVERYTHING = Usd.TraverseInstanceProxies(Usd.PrimIsActive & Usd.PrimIsLoaded)
"""Also what only stands in an `over`, as prototypes of point instancers may."""


class Skins:
    """Finds the skin of any prim of a stage; skeletons are posed once.

    Args:
        stage: The stage.
        time: The time to pose at.
        log: Gets a line for every skin that cannot be used.
    """

    def __init__(self, stage: Usd.Stage, time: Usd.TimeCode, log: WarningLog) -> None:
        self._time = time
        self._log = log
        self._cache = UsdSkel.Cache()
        self._skins: dict[Sdf.Path, Skin] = {}
        self._roots: set[Sdf.Path] = set()
        self._poses: dict[tuple[Sdf.Path, ...], Vt.Matrix4dArray | None] = {}
        # Most stages have no skeletons: then no prim needs to look for one.
        ranges = [Usd.PrimRange.AllPrims(root) for root in (stage.GetPseudoRoot(), *stage.GetPrototypes())]
        self._any = any(prim.IsA(UsdSkel.Root) for prims in ranges for prim in prims)

    def of(self, prim: Usd.Prim) -> Skin | None:
        """The skin of a prim; None if it has none: it is outside a SkelRoot, or bound to no skeleton."""
        if not self._any:
            return None
        root = UsdSkel.Root.Find(prim)
        if not root:
            return None
        if root.GetPath() not in self._roots:
            self._roots.add(root.GetPath())
            self._find(root)
        return self._skins.get(prim.GetPath())

    def _find(self, root: UsdSkel.Root) -> None:
        self._cache.Populate(root, EVERYTHING)
        for binding in self._cache.ComputeSkelBindings(root, EVERYTHING):
            # The query's own prim would be the prototype's where the skeleton is instanced.
            prim = binding.GetSkeleton().GetPrim()
            skeleton = self._cache.GetSkelQuery(binding.GetSkeleton())
            if not skeleton:
                self._log.add("the skeleton cannot be used, its meshes are not skinned", prim.GetPath())
                continue
            animation = skeleton.GetAnimQuery()
            key = tuple(canonical_path(p) for p in (prim, animation.GetPrim() if animation else None) if p)
            if key not in self._poses:
                self._poses[key] = self._pose(skeleton)
            for target in binding.GetSkinningTargets():
                skin = Skin(target, prim, animation, key, self._poses[key], self._time, self._log)
                self._skins[target.GetPrim().GetPath()] = skin

    def _pose(self, skeleton: UsdSkel.SkeletonQuery) -> Vt.Matrix4dArray | None:
        transforms = skeleton.ComputeSkinningTransforms(self._time)
        # A bind transform without an inverse makes numbers that are finite, but huge.
        if not transforms or not np.all(np.abs(np.asarray(transforms)) < HUGE):
            self._log.add("the skeleton has no pose, its meshes keep their bind pose", skeleton.GetPrim().GetPath())
            return None
        return transforms


@dataclass(frozen=True, slots=True)
class Skin:
    """How one prim is deformed.

    Attributes:
        query: UsdSkel's view of the prim.
        skeleton: Its skeleton's prim, maybe an instance proxy.
        animation: What animates that, or None.
        key: What decides the pose, apart from the prim itself: canonical paths of skeleton and animation.
        pose: Skinning transform of every joint of the skeleton; None where there is none.
        time: The time code of the pose.
        log: Gets a line where data do not fit.
    """

    query: UsdSkel.SkinningQuery
    skeleton: Usd.Prim
    animation: UsdSkel.AnimQuery | None
    key: tuple[Sdf.Path, ...]
    pose: Vt.Matrix4dArray | None
    time: Usd.TimeCode
    log: WarningLog

    @property
    def anchor(self) -> Usd.Prim | None:
        """The skeleton's prim, where the skin is in its space; None where blend shapes alone deform the prim."""
        return self.skeleton if self._jointed() else None

    def _jointed(self) -> bool:
        return self.pose is not None and bool(self.query.HasJointInfluences())

    def points(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Deformed points, float64 [P, 3], in the space of `anchor`.

        Args:
            points: float64 [P, 3], the prim's own space.
        """
        moved = self._blended(points, normals=False)
        if not self._jointed():
            return moved
        if self.query.IsRigidlyDeformed():
            matrix = self._rigid()
            return moved @ matrix[:3, :3] + matrix[3, :3]
        posed = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(moved, dtype=np.float32))
        if not self.query.ComputeSkinnedPoints(self.pose, posed, self.time):
            self._bad("its joint indices and weights do not fit its points")
            return moved
        return np.asarray(posed, dtype=np.float64)

    def normals(self, normals: Attribute, topology: Topology) -> Attribute | None:
        """Deformed normals; None where they are better computed from the deformed points.

        Args:
            normals: As authored, any domain.
            topology: Of the mesh, for the joints of a corner.

        Returns:
            Rows of any length.
        """
        values = normals.values.astype(np.float64)
        if normals.domain == "vertex":
            values = self._blended(values, normals=True)
        elif self._weights() is not None:
            return None
        turned: NDArray[np.float64] | None = values
        if self._jointed() and self.query.IsRigidlyDeformed():
            turned = values @ _normal_matrix(self._rigid())
        elif self._jointed():
            turned = self._turned(values, normals.domain, topology)
        return None if turned is None else Attribute(turned.astype(np.float32), normals.domain)

    def _rigid(self) -> NDArray[np.float64]:
        return np.array(self.query.ComputeSkinnedTransform(self.pose, self.time), dtype=np.float64)

    def _turned(self, values: NDArray[np.float64], domain: Domain, topology: Topology) -> NDArray[np.float64] | None:
        points = topology.points
        influences = self.query.ComputeVaryingJointInfluences(points, self.time)
        if domain not in ("vertex", "corner") or influences is None:
            return None
        each = self.query.GetNumInfluencesPerComponent()
        joints = np.asarray(influences[0], dtype=np.int32).reshape(points, each)
        weights = np.asarray(influences[1], dtype=np.float32).reshape(points, each)
        if domain == "corner":
            joints, weights = joints[topology.corners], weights[topology.corners]
        transforms = self._joint_transforms()
        normals = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(values, dtype=np.float32))
        done = UsdSkel.SkinNormals(
            self.query.GetSkinningMethod(),
            Gf.Matrix3f(*_normal_matrix(np.array(self.query.GetGeomBindTransform(self.time))).ravel().tolist()),
            Vt.Matrix3fArray([Gf.Matrix3f(*_normal_matrix(m).ravel().tolist()) for m in transforms]),
            Vt.IntArray.FromNumpy(np.ascontiguousarray(joints.ravel())),
            Vt.FloatArray.FromNumpy(np.ascontiguousarray(weights.ravel())),
            each,
            normals,
        )
        return np.asarray(normals, dtype=np.float64) if done else None

    def _joint_transforms(self) -> NDArray[np.float64]:
        """Skinning transforms in the order of the prim's own `skel:joints`, float64 [J, 4, 4]."""
        mapper = self.query.GetJointMapper()
        mapped = mapper.RemapTransforms(self.pose, Vt.Matrix4dArray()) if mapper else self.pose
        return np.asarray(mapped if mapped is not None else self.pose, dtype=np.float64)

    def _weights(self) -> NDArray[np.float64] | None:
        """Weights of the prim's blend shapes in its own order; None where nothing animates them."""
        if not self.query.HasBlendShapes() or not self.animation:
            return None
        weights = self.animation.ComputeBlendShapeWeights(self.time)
        mapper = self.query.GetBlendShapeMapper()
        if weights is None or not len(weights):
            return None
        mapped = mapper.Remap(weights) if mapper else weights
        values = np.asarray(mapped, dtype=np.float64)
        return values if np.any(values) and np.isfinite(values).all() else None

    def _blended(self, values: NDArray[np.float64], *, normals: bool) -> NDArray[np.float64]:
        """Points or normals plus the weighted offsets of all blend shapes and inbetweens, float64 [P, 3]."""
        weights = self._weights()
        if weights is None:
            return values
        shapes = UsdSkel.BlendShapeQuery(UsdSkel.BindingAPI(self.query.GetPrim()))
        parts = shapes.ComputeSubShapeWeights(Vt.FloatArray.FromNumpy(weights.astype(np.float32)))
        indices = shapes.ComputeBlendShapePointIndices()
        moved = values.copy()
        for weight, shape, part in zip(*(np.asarray(column).tolist() for column in parts), strict=True):
            offsets = _offsets(shapes, shape, part, normals)
            at = np.asarray(indices[shape], dtype=np.int64)
            if offsets is None or weight == 0.0:
                continue
            rows = at if len(at) else np.arange(len(values))
            if len(rows) != len(offsets) or (len(rows) and (rows.min() < 0 or rows.max() >= len(values))):
                self._bad(f"its blend shape {shapes.GetBlendShape(shape).GetPath()} does not fit its points")
                continue
            np.add.at(moved, rows, weight * offsets)
        return moved

    def _bad(self, reason: str) -> None:
        self.log.add(f"the prim is not deformed, {reason}", self.query.GetPrim().GetPath())


def _offsets(shapes: UsdSkel.BlendShapeQuery, shape: int, part: int, normals: bool) -> NDArray[np.float64] | None:
    """Offsets of a blend shape or of one of its inbetweens, float64 [n, 3]; None where it has none."""
    between = shapes.GetInbetween(part)
    if between:
        values = between.GetNormalOffsets() if normals else between.GetOffsets()
    else:
        target = shapes.GetBlendShape(shape)
        if not target:
            return None
        values = (target.GetNormalOffsetsAttr() if normals else target.GetOffsetsAttr()).Get()
    return None if values is None or not len(values) else np.asarray(values, dtype=np.float64)


def _normal_matrix(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """What normals turn with, float64 [3, 3]: the inverse transpose; the matrix itself where there is no inverse."""
    part = matrix[:3, :3]
    return np.asarray(np.linalg.inv(part).T if abs(np.linalg.det(part)) > 1e-30 else part, dtype=np.float64)
