"""Which views of a scene are rendered: its own cameras, a views file, or seeded samples around the geometry."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from renderer.rooms import Room, find_room
from schemas.problem import ExitCode, Problem
from schemas.scene import SceneArrays
from schemas.view import ListedView, Vec3, View

Floats = NDArray[np.float64]

ASPECT = 1.5
"""Width / height that sampled views are framed for; 1430x960 is close to it."""
FRAMING_ASPECT = 20.955 / 15.2908
"""Width / height of `framing_view`."""
_DEFAULT_APERTURE, _DEFAULT_FOCAL = (20.955, 15.2908), 50.0
"""Of a UsdGeomCamera: millimetres."""
_FRAMING_TURN, _FRAMING_ELEVATION = 25.0, 20.0
"""Degrees."""
_FRAMING_MARGIN = 1.02
SAMPLED_POINTS = 4096
"""Vertices that stand for the geometry when views are sampled."""


class _ListedScene(BaseModel):
    model_config = ConfigDict(extra="ignore")

    main: str | None = None
    views: tuple[ListedView, ...] = ()


class _ViewsFile(BaseModel):
    model_config = ConfigDict(extra="ignore")

    scenes: tuple[_ListedScene, ...]


def listed_views(path: Path, scene_path: Path) -> tuple[ListedView, ...]:
    """The views that a views file lists for a scene; none if it lists none.

    Args:
        path: JSON `{"scenes": [{"main": FILE, "views": [{"eye", "target", "up", "fov"}]}]}`; FILE is relative to the
            JSON file, the numbers are in stage units and axes, fov is vertical, degrees.
        scene_path: The scene's root layer.

    Raises:
        Problem: The file is missing or has not that form.
    """
    try:
        listed = _ViewsFile.model_validate_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise Problem(f"There is no views file {path}.", "Check the path.", ExitCode.NOT_FOUND) from error
    except (ValidationError, OSError, UnicodeDecodeError) as error:
        raise Problem(
            f"{path} is not a views file: {_first_line(error)}.",
            'Give JSON {"scenes": [{"main": "file.usd", "views": [{"eye", "target", "up", "fov"}]}]}.',
            ExitCode.USAGE,
        ) from error
    wanted = scene_path.resolve()
    return tuple(v for s in listed.scenes if s.main and (path.parent / s.main).resolve() == wanted for v in s.views)


def placed_views(listed: Sequence[ListedView], scene: SceneArrays) -> tuple[View, ...]:
    """Listed views in metres, relative to the scene's origin.

    Raises:
        Problem: One of them has no direction.
    """
    return tuple(_placed(f"view{i}", view, scene) for i, view in enumerate(listed))


def scene_views(scene: SceneArrays, count: int, seed: int) -> tuple[View, ...]:
    """Views to render a scene from: its cameras if it has any, else `count` sampled ones.

    Args:
        scene: The scene.
        count: How many views to sample; cameras are taken as they are, at most `count`.
        seed: Decides the samples; the same seed gives the same views.
    """
    return scene.cameras[:count] if scene.cameras else sampled_views(scene, count, seed)


def sampled_views(scene: SceneArrays, count: int, seed: int) -> tuple[View, ...]:
    """Seeded views around the geometry, every third one inside it where it has a room.

    Azimuths follow the golden angle, so that any number of them is spread evenly; elevation, field of view and how
    much of the picture is filled vary with the seed.
    """
    rng = np.random.default_rng(seed)
    points = _sample_points(scene)
    start = float(rng.uniform(0.0, 2.0 * np.pi))
    room = find_room(scene)
    views = []
    for number in range(count):
        azimuth = start + number * np.pi * (3.0 - np.sqrt(5.0))
        numbers = rng.uniform(0.0, 1.0, 4)
        if room is not None and number % 3 == 1:
            views.append(_inside_view(f"view{number}", scene, room, numbers))
        else:
            views.append(_orbit_view(f"view{number}", scene, points, azimuth, numbers))
    return tuple(views)


def framing_view(scene: SceneArrays) -> View:
    """The whole scene, seen from the front, a little from above and beside, so that no side is seen edge-on.

    The lens is that of `usdrecord` for a stage without cameras (and of a new UsdGeomCamera); it stands straight in
    front of the bounds, which shows nothing of a plane along the view axis.
    """
    up = int(np.argmax(np.abs(np.array(scene.up))))
    # The front is +z where y is up, and -y where z is.
    azimuth = np.radians(_FRAMING_TURN - (90.0 if up == 2 else 0.0))
    back = _direction(scene.up, float(azimuth), float(np.radians(_FRAMING_ELEVATION)))
    half = 0.5 * _DEFAULT_APERTURE[1] / _DEFAULT_FOCAL
    centre = 0.5 * (scene.bounds[0] + scene.bounds[1])
    distance = _FRAMING_MARGIN * float(_needed(_sample_points(scene) - centre, back, scene, half, FRAMING_ASPECT).max())
    fov = 2.0 * float(np.degrees(np.arctan(half)))
    return _view("whole", centre + max(distance, 1e-6) * back, centre, scene, fov)


def _needed(offset: Floats, back: Floats, scene: SceneArrays, half: float, aspect: float) -> Floats:
    """How far along `back` the eye must be for each point to be in the frame: |offset . axis| <= half * depth."""
    right, over = _frame(back, np.array(scene.up))
    depth = offset @ back
    return np.asarray(np.maximum(np.abs(offset @ right) / (half * aspect), np.abs(offset @ over) / half) + depth)


def _orbit_view(name: str, scene: SceneArrays, points: Floats, azimuth: float, numbers: Floats) -> View:
    """Around the object, between its middle and high above, so far away that it fills the frame."""
    elevation = np.radians(4.0 + 46.0 * float(numbers[0]) ** 1.5)
    fov = 32.0 + 20.0 * float(numbers[1])
    back = _direction(scene.up, azimuth, float(elevation))
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    half_v = np.tan(np.radians(0.5 * fov))
    needed = _needed(points - centre, back, scene, float(half_v), ASPECT)
    distance = float(np.quantile(needed, 0.995)) * (0.85 + 0.3 * float(numbers[2]))
    distance = max(distance, 1e-3 * float(np.linalg.norm(scene.bounds[1] - scene.bounds[0])), 1e-6)
    return _view(name, centre + distance * back, centre, scene, fov)


def _inside_view(name: str, scene: SceneArrays, room: Room, numbers: Floats) -> View:
    """From one of the room's free places, along the longest free line there, slightly turned."""
    pick = min(int(numbers[0] * len(room.places)), len(room.places) - 1)
    up = np.array(scene.up)
    ahead = room.ahead[pick]
    turn = np.radians(50.0 * (float(numbers[1]) - 0.5))
    look = np.cos(turn) * ahead + np.sin(turn) * np.cross(up, ahead) + up * 0.5 * (float(numbers[2]) - 0.4)
    eye = room.places[pick]
    target = eye + look * 0.1 * float(np.linalg.norm(scene.bounds[1] - scene.bounds[0]))
    return _view(name, eye, target, scene, 55.0 + 15.0 * float(numbers[3]))


def _direction(up: Vec3, azimuth: float, elevation: float) -> Floats:
    """Unit vector at an azimuth about the up axis and an elevation above its plane, radians."""
    axis = int(np.argmax(np.abs(np.array(up))))
    a, b = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    flat = np.cos(azimuth) * a + np.sin(azimuth) * b
    return np.asarray(np.cos(elevation) * flat + np.sin(elevation) * np.array(up))


def _frame(back: Floats, up: Floats) -> tuple[Floats, Floats]:
    right = np.cross(up, back)
    right = right / np.linalg.norm(right)
    return right, np.cross(back, right)


def _sample_points(scene: SceneArrays) -> Floats:
    """Vertices that triangles use, evenly picked, float64 [<= SAMPLED_POINTS, 3]."""
    step = max(1, len(scene.indices) // SAMPLED_POINTS)
    return scene.positions[scene.indices[::step]].astype(np.float64)


def _view(name: str, eye: Floats, target: Floats, scene: SceneArrays, fov: float) -> View:
    return View(name=name, eye=_vec3(eye), target=_vec3(target), up=scene.up, fov=fov)


def _placed(name: str, listed: ListedView, scene: SceneArrays) -> View:
    metres, origin = scene.metres_per_unit, scene.origin
    eye, target = (np.array(p) * metres - origin for p in (listed.eye, listed.target))
    view = View(name=name, eye=_vec3(eye), target=_vec3(target), up=listed.up, fov=listed.fov)
    try:
        view.world_to_view()
    except ValueError as error:
        raise Problem(f"{name} of {scene.name} is no view: {error}.", "Correct that view.") from error
    return view


def _vec3(v: Floats) -> Vec3:
    return float(v[0]), float(v[1]), float(v[2])


def _first_line(error: Exception) -> str:
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        return f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}"
    return str(error).splitlines()[0]
