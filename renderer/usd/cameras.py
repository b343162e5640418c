"""Cameras of a stage as views."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.stage import WarningLog
from schemas.view import View

APERTURE_UNIT = 0.1
"""USD gives apertures and focal lengths in tenths of a scene unit."""


@dataclass(frozen=True, slots=True)
class StageCamera:
    """A camera of a stage.

    Attributes:
        path: Its prim.
        view: What it sees; the name is the prim's, made unique.
        aspect: Width / height of its aperture.
    """

    path: str
    view: View
    aspect: float


def read_cameras(
    stage: Usd.Stage, time: Usd.TimeCode, origin: NDArray[np.float64], metres: float, log: WarningLog
) -> tuple[StageCamera, ...]:
    """All cameras that can be used, in traversal order.

    Args:
        stage: The stage.
        time: The time to read at.
        origin: float64 [3], metres, stage space; views are relative to it.
        metres: Metres per stage unit.
        log: Gets a line for every camera that cannot be used.
    """
    cache = UsdGeom.XformCache(time)
    cameras: list[StageCamera] = []
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Camera):
            continue
        matrix = np.array(cache.GetLocalToWorldTransform(prim), dtype=np.float64)
        view = _view(UsdGeom.Camera(prim), matrix, time, origin, metres, log)
        if view is not None:
            taken = {camera.view.name for camera in cameras}
            number = 2
            name = view.name
            while name in taken:
                name, number = f"{view.name}{number}", number + 1
            view = view.model_copy(update={"name": name})
            cameras.append(StageCamera(str(prim.GetPath()), view, _aspect(UsdGeom.Camera(prim), time)))
    return tuple(cameras)


def _aspect(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    """Width / height of the aperture; 1 where it has none, as `usdrecord` has it."""
    width, height = camera.GetHorizontalApertureAttr().Get(time), camera.GetVerticalApertureAttr().Get(time)
    aspect = float(width) / float(height) if width and height else 0.0
    return aspect if math.isfinite(aspect) and aspect > 1e-4 else 1.0


def _view(
    camera: UsdGeom.Camera,
    matrix: NDArray[np.float64],
    time: Usd.TimeCode,
    origin: NDArray[np.float64],
    metres: float,
    log: WarningLog,
) -> View | None:
    path = camera.GetPath()
    aperture = float(camera.GetVerticalApertureAttr().Get(time) or 0.0)
    focal = float(camera.GetFocalLengthAttr().Get(time) or 0.0)
    ortho = camera.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic
    back, up = (_direction(matrix[row, :3]) for row in (2, 1))
    sizes = (aperture, focal if not ortho else 1.0)
    if back is None or up is None or not all(math.isfinite(s) and s > 0.0 for s in sizes):
        log.add("the camera's transform, aperture or focal length cannot be used, left out", path)
        return None
    eye = matrix[3, :3] * metres - origin
    distance = _focus(camera, time) * metres
    target = eye - back * (distance if distance > 0.0 else max(float(np.linalg.norm(eye)), 1e-3))
    near, far = _clipping(camera, time, metres)
    return View(
        name=str(camera.GetPrim().GetName()),
        eye=_vec3(eye),
        target=_vec3(target),
        up=_vec3(up),
        fov=45.0 if ortho else math.degrees(2.0 * math.atan(aperture / (2.0 * focal))),
        ortho_height=aperture * APERTURE_UNIT * metres if ortho else None,
        near=near,
        far=far,
        shift=_shift(camera, time, aperture, log),
    )


def _shift(camera: UsdGeom.Camera, time: Usd.TimeCode, aperture: float, log: WarningLog) -> tuple[float, float]:
    """Aperture offsets in picture heights; a picture of another shape than the aperture keeps its height (GfCamera)."""
    offsets = (camera.GetHorizontalApertureOffsetAttr().Get(time), camera.GetVerticalApertureOffsetAttr().Get(time))
    right, up = (float(offset or 0.0) / aperture for offset in offsets)
    if not (math.isfinite(right) and math.isfinite(up)):
        log.add("the camera's aperture offset is not finite, left out", camera.GetPath())
        return 0.0, 0.0
    return right, up


def _clipping(camera: UsdGeom.Camera, time: Usd.TimeCode, metres: float) -> tuple[float | None, float | None]:
    """Authored near and far distance, metres; a default of 1 unit would cut scenes that are small."""
    attribute = camera.GetClippingRangeAttr()
    if not attribute.HasAuthoredValue():
        return None, None
    near, far = (float(x) * metres for x in attribute.Get(time))
    if not (math.isfinite(near) and math.isfinite(far) and far > near):
        return None, None
    return (near if near > 0.0 else None), (far if far > 0.0 else None)


def _focus(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    distance = float(camera.GetFocusDistanceAttr().Get(time) or 0.0)
    return distance if math.isfinite(distance) else 0.0


def _direction(row: NDArray[np.float64]) -> NDArray[np.float64] | None:
    length = float(np.linalg.norm(row))
    return row / length if math.isfinite(length) and length > 0.0 else None


def _vec3(v: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
