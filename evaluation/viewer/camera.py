"""A camera that is led around: every movement makes a new view of an old one.

Angles are radians, positions metres in the scene's axes. Roll, lens and lens shift of a view stay as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.view import Vec3, View

Floats = NDArray[np.float64]

POLE = np.radians(1.0)
"""So close a camera is turned towards straight up or down: beyond, left and right would swap."""
LEAST_DISTANCE = 1e-3
"""Nearest distance of the eye from what it turns about, as a share of the diagonal of the scene."""
MOST_DISTANCE = 1e4
"""Farthest that it is led away, likewise: from there a scene is no larger than a pixel, and numbers stay exact."""
_AHEAD = 0.05
"""Where the scene is behind the camera, it turns about a point so far ahead, as a share of the diagonal."""


def aimed(view: View, bounds: NDArray[np.floating]) -> View:
    """The same view, its target where the view axis is nearest to the middle of the scene: what it will turn about.

    Args:
        view: Any view.
        bounds: [2, 3], least and greatest corner of the scene.
    """
    eye, ahead = np.array(view.eye), _unit(np.array(view.target) - np.array(view.eye))
    depth = float((0.5 * (bounds[0] + bounds[1]) - eye) @ ahead)
    return _moved(view, target=eye + max(depth, _AHEAD * _diagonal(bounds)) * ahead)


def turned(view: View, up: Vec3, azimuth: float, elevation: float) -> View:
    """The camera led around its target.

    Args:
        view: The camera.
        up: The scene's up axis.
        azimuth: About that axis, counterclockwise as seen from above.
        elevation: Upwards; no further than `POLE` from straight up or down, unless it is there already.
    """
    axis, offset = _unit(np.array(up)), np.array(view.eye) - np.array(view.target)
    polar = float(np.arccos(np.clip(_unit(offset) @ axis, -1.0, 1.0)))
    least, most = min(POLE, polar), max(np.pi - POLE, polar)
    aside = np.cross(axis, offset)
    if float(np.linalg.norm(aside)) < 1e-9 * float(np.linalg.norm(offset)):
        aside = np.cross(np.array(view.up), offset)  # straight up or down: what the camera has to its right
    # Away from the axis is the positive sense about `aside`.
    tilt = _rotation(_unit(aside), float(np.clip(polar - elevation, least, most)) - polar)
    turn = _rotation(axis, azimuth) @ tilt
    return _moved(view, eye=np.array(view.target) + turn @ offset, up=turn @ np.array(view.up))


def panned(view: View, right: float, over: float) -> View:
    """The camera moved sideways in its picture's plane.

    Args:
        view: The camera.
        right: To the right, as a share of the height that the picture shows at the target's distance.
        over: Upwards, likewise.
    """
    to_view = view.world_to_view()
    step = _height(view) * (right * to_view[0, :3] + over * to_view[1, :3])
    return _moved(view, eye=np.array(view.eye) + step, target=np.array(view.target) + step)


def zoomed(view: View, factor: float, bounds: NDArray[np.floating]) -> View:
    """The camera nearer to its target, or farther away.

    Args:
        view: The camera.
        factor: Of the distance, > 0; below 1 is nearer. An orthographic window shrinks by it as well.
        bounds: [2, 3] of the scene, to whose size the least and the greatest distance are relative.
    """
    offset = np.array(view.eye) - np.array(view.target)
    size = _diagonal(bounds) / float(np.linalg.norm(offset))
    # A camera that is farther away from the beginning stays there, and can come nearer.
    factor = max(min(factor, max(MOST_DISTANCE * size, 1.0)), LEAST_DISTANCE * size)
    moved = _moved(view, eye=np.array(view.target) + factor * offset)
    if view.ortho_height is None:
        return moved
    return moved.model_copy(update={"ortho_height": factor * view.ortho_height})


def orbit(view: View, up: Vec3, bounds: NDArray[np.floating], number: int, count: int) -> View:
    """A view of the full turn of `count` frames that begins with, and returns to, a view.

    Args:
        view: The first of them, which is given unchanged as number 0.
        up: The scene's up axis.
        bounds: [2, 3] of the scene.
        number: Which frame.
        count: Frames of the whole turn.
    """
    if number == 0:
        return view
    return turned(aimed(view, bounds), up, 2.0 * np.pi * number / count, 0.0)


def _height(view: View) -> float:
    """Height that the picture shows at the target's distance, metres."""
    if view.ortho_height is not None:
        return view.ortho_height
    distance = float(np.linalg.norm(np.array(view.eye) - np.array(view.target)))
    return 2.0 * distance * float(np.tan(np.radians(0.5 * view.fov)))


def _moved(view: View, **places: Floats) -> View:
    return view.model_copy(update={name: tuple(place.tolist()) for name, place in places.items()})


def _rotation(axis: Floats, angle: float) -> Floats:
    """float64 [3, 3] about a unit axis: Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross))


def _diagonal(bounds: NDArray[np.floating]) -> float:
    return float(np.linalg.norm(bounds[1] - bounds[0])) or 1.0


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v))
