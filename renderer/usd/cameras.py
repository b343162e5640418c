"""Cameras of a stage as views."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pxr import Usd, UsdGeom

from renderer.usd.drivers import floats_of
from renderer.usd.stage import WarningLog
from renderer.usd.transforms import Transforms
from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.view import View

APERTURE_UNIT = 0.1
"""USD gives apertures and focal lengths in tenths of a scene unit."""
OPENINGS = (1e-6, 1e6)
"""Tangents of half the angle of view that a picture can be made with."""
WINDOWS = (1e-12, 1e15)
"""Heights of an orthographic window that a picture can be made with, metres."""
FARTHEST = 1e20
"""Metres from the scene to a camera, along each axis."""


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

    Raises:
        Problem: The name of one is too long for a view's.
    """
    transforms = Transforms(time, log)
    cameras: list[StageCamera] = []
    for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
        if not prim.IsA(UsdGeom.Camera):
            continue
        name = _name(prim, {camera.view.name for camera in cameras})
        view = _view(UsdGeom.Camera(prim), name, transforms.to_world(prim), time, origin, metres, log)
        if view is not None:
            cameras.append(StageCamera(str(prim.GetPath()), view, _aspect(UsdGeom.Camera(prim), time)))
    return tuple(cameras)


def _name(prim: Usd.Prim, taken: set[str]) -> str:
    own = name = str(prim.GetName())
    number = 2
    while name in taken:
        name, number = f"{own}{number}", number + 1
    if len(name) > LIMITS.view_name:
        raise Problem(
            f"The camera {own[:40]}... has a name of {len(own)} characters.",
            f"Rename it: the name of a view has at most {LIMITS.view_name}.",
            ExitCode.LIMIT,
        )
    return name


def _aspect(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    """Width / height of the aperture; 1 where it has none, as `usdrecord` has it."""
    width, height = _number(camera.GetHorizontalApertureAttr(), time), _number(camera.GetVerticalApertureAttr(), time)
    aspect = width / height if height else 0.0
    return aspect if math.isfinite(aspect) and aspect > 1e-4 else 1.0


def _view(
    camera: UsdGeom.Camera,
    name: str,
    matrix: NDArray[np.float64],
    time: Usd.TimeCode,
    origin: NDArray[np.float64],
    metres: float,
    log: WarningLog,
) -> View | None:
    path = camera.GetPath()
    aperture = _number(camera.GetVerticalApertureAttr(), time)
    focal = _number(camera.GetFocalLengthAttr(), time)
    ortho = camera.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic
    # A window's height over its distance; an orthographic one has only a height, in metres.
    opening = aperture * APERTURE_UNIT * metres if ortho else _ratio(aperture, 2.0 * focal)
    least, most = WINDOWS if ortho else OPENINGS
    back, up = (_direction(matrix[row, :3]) for row in (2, 1))
    eye = matrix[3, :3] * metres - origin
    if (
        (back is None or up is None)
        or not np.all(np.abs(eye) < FARTHEST)
        or np.linalg.norm(np.cross(back, up)) < 1e-6
        or not least <= opening <= most
    ):
        log.add("the camera's transform, aperture or focal length cannot be used, left out", path)
        return None
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        log.add("the camera's transform mirrors, its picture is not mirrored", path)
    distance, away = _focus(camera, time) * metres, float(np.linalg.norm(eye))
    # A target too near to tell from the eye would be no target.
    target = eye - back * (distance if distance > 1e-6 * away else max(away, 1e-3))
    near, far = _clipping(camera, time, metres, log)
    return View(
        name=name,
        eye=_vec3(eye),
        target=_vec3(target),
        up=_vec3(up),
        fov=45.0 if ortho else math.degrees(2.0 * math.atan(opening)),
        ortho_height=opening if ortho else None,
        near=near,
        far=far,
        shift=_shift(camera, time, aperture, log),
    )


def _shift(camera: UsdGeom.Camera, time: Usd.TimeCode, aperture: float, log: WarningLog) -> tuple[float, float]:
    """Aperture offsets in picture heights; a picture of another shape than the aperture keeps its height (GfCamera)."""
    offsets = (camera.GetHorizontalApertureOffsetAttr(), camera.GetVerticalApertureOffsetAttr())
    right, up = (_ratio(_number(offset, time), aperture) for offset in offsets)
    if not (math.isfinite(right) and math.isfinite(up)):
        log.add("the camera's aperture offset is not finite, left out", camera.GetPath())
        return 0.0, 0.0
    return right, up


def _clipping(
    camera: UsdGeom.Camera, time: Usd.TimeCode, metres: float, log: WarningLog
) -> tuple[float | None, float | None]:
    """Authored near and far distance, metres; a default of 1 unit would cut scenes that are small."""
    if camera.GetClippingPlanesAttr().Get(time):
        log.add("the camera's clipping planes are not used", camera.GetPath())
    attribute = camera.GetClippingRangeAttr()
    if not attribute.HasAuthoredValue():
        return None, None
    authored = floats_of(attribute.Get(time), 2)
    if authored is None or authored[1] <= authored[0]:
        log.add("the camera's clipping range is not used, it is none", camera.GetPath())
        return None, None
    near, far = authored[0] * metres, authored[1] * metres
    return (near if near > 0.0 else None), (far if far > 0.0 else None)


def _focus(camera: UsdGeom.Camera, time: Usd.TimeCode) -> float:
    distance = _number(camera.GetFocusDistanceAttr(), time)
    return distance if math.isfinite(distance) else 0.0


def _number(attribute: Usd.Attribute, time: Usd.TimeCode) -> float:
    """The attribute's value; not a number if it has none, or one that is not finite or of another type."""
    found = floats_of(attribute.Get(time), 1)
    return found[0] if found else math.nan


def _ratio(a: float, b: float) -> float:
    return a / b if b else math.nan


def _direction(row: NDArray[np.float64]) -> NDArray[np.float64] | None:
    length = float(np.linalg.norm(row))
    return row / length if math.isfinite(length) and length > 0.0 else None


def _vec3(v: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])
