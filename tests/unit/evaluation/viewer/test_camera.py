"""A camera that is led around: distances, directions and ways back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.viewer.camera import LEAST_DISTANCE, MOST_DISTANCE, POLE, aimed, orbit, panned, turned, zoomed
from schemas.view import View

BOUNDS = np.array([[-1.0, -2.0, -1.0], [3.0, 2.0, 1.0]])
UP = (0.0, 1.0, 0.0)

places = st.floats(-10.0, 10.0, allow_subnormal=False)
turns = st.floats(-0.5, 0.5)


@st.composite
def views(draw: st.DrawFn) -> View:
    eye, target = np.array([draw(places) for _ in range(3)]), np.array([draw(places) for _ in range(3)])
    offset = eye - target
    aside = np.hypot(offset[0], offset[2])
    if aside < 0.2 + 0.2 * abs(offset[1]):
        eye[0] += 1.0 + abs(offset[0]) + abs(offset[1])
    return View(name="v", eye=tuple(eye.tolist()), target=tuple(target.tolist()), up=UP, fov=40.0)


def distance(view: View) -> float:
    return float(np.linalg.norm(np.array(view.eye) - np.array(view.target)))


def elevation(view: View) -> float:
    offset = np.array(view.eye) - np.array(view.target)
    return float(np.arcsin(offset[1] / np.linalg.norm(offset)))


@given(views(), turns, turns)
def test_turning_keeps_distance_and_horizon_and_can_be_undone(view: View, azimuth: float, up: float) -> None:
    led = turned(view, UP, azimuth, up)
    assert distance(led) == pytest.approx(distance(view), rel=1e-12)
    assert abs(elevation(led)) <= np.pi / 2 - POLE + 1e-6
    assert led.world_to_view()[0, 1] == pytest.approx(0.0, abs=1e-9)  # the camera's right stays level
    if abs(elevation(view) + up) < np.pi / 2 - POLE:
        assert elevation(led) == pytest.approx(elevation(view) + up, abs=1e-6)
        back = turned(led, UP, -azimuth, -up)
        assert back.world_to_view() == pytest.approx(view.world_to_view(), abs=1e-6)


@given(views(), turns)
def test_turning_is_about_the_scenes_up_axis(view: View, azimuth: float) -> None:
    led = turned(view, UP, azimuth, 0.0)
    before, after = (np.array(each.eye) - np.array(each.target) for each in (view, led))
    assert after[1] == pytest.approx(before[1], abs=1e-9)
    angle = np.arctan2(-after[2], after[0]) - np.arctan2(-before[2], before[0])
    assert np.angle(np.exp(1j * (angle - azimuth))) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_nobody_is_led_over_a_pole_and_who_stands_there_comes_down(sign: float) -> None:
    view = View(name="v", eye=(0.0, 1.0, 5.0), target=(0.0, 0.0, 0.0), up=UP)
    assert elevation(turned(view, UP, 0.0, sign * 4.0)) == pytest.approx(sign * (np.pi / 2 - POLE))
    above = View(name="v", eye=(0.0, sign * 5.0, 0.0), target=(0.0, 0.0, 0.0), up=(0.0, 0.0, -1.0))
    assert turned(above, UP, 0.0, sign) == above
    assert elevation(turned(above, UP, 0.0, -sign * 0.3)) == pytest.approx(sign * (np.pi / 2 - 0.3))


def test_a_roll_stays() -> None:
    rolled = View(name="v", eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.6, 0.8, 0.0))
    led = turned(rolled, UP, 0.7, 0.0)
    assert led.world_to_view()[1, 1] == pytest.approx(0.8)


@given(views(), turns, turns)
def test_what_is_at_the_target_moves_with_the_mouse(view: View, right: float, up: float) -> None:
    moved = panned(view, right, up)
    assert np.array(moved.eye) - np.array(moved.target) == pytest.approx(np.array(view.eye) - np.array(view.target))
    at = moved.world_to_view() @ np.array([*view.target, 1.0])
    clip = moved.projection(1.0, 0.1, 100.0) @ at
    # Clip space is two picture heights high.
    assert clip[:2] / clip[3] == pytest.approx([-2.0 * right, -2.0 * up], abs=1e-6)


def test_zooming_stops_before_the_target_and_shrinks_a_parallel_window() -> None:
    view = View(name="v", eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), up=UP)
    assert zoomed(view, 0.5, BOUNDS).eye == (0.0, 0.0, 2.5)
    diagonal = float(np.linalg.norm(BOUNDS[1] - BOUNDS[0]))
    assert distance(zoomed(view, 1e-9, BOUNDS)) == pytest.approx(LEAST_DISTANCE * diagonal)
    assert zoomed(view.model_copy(update={"ortho_height": 4.0}), 0.5, BOUNDS).ortho_height == 2.0


def test_zooming_out_stops_where_there_is_nothing_to_see_and_leads_back() -> None:
    far = view = View(name="v", eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), up=UP, ortho_height=4.0)
    for _ in range(1000):
        far = zoomed(far, 10.0, BOUNDS)
    diagonal = float(np.linalg.norm(BOUNDS[1] - BOUNDS[0]))
    assert distance(far) == pytest.approx(MOST_DISTANCE * diagonal)
    back = zoomed(far, distance(view) / distance(far), BOUNDS)
    assert back.eye == pytest.approx(view.eye)
    assert back.ortho_height == pytest.approx(4.0)
    # One that is farther away from the beginning does not jump.
    beyond = view.model_copy(update={"eye": (0.0, 0.0, 1e9)})
    assert zoomed(beyond, 2.0, BOUNDS) == beyond
    assert distance(zoomed(beyond, 0.5, BOUNDS)) == 5e8


@given(views())
def test_aiming_moves_nothing_but_the_target_which_is_abreast_of_the_scenes_middle(view: View) -> None:
    aim = aimed(view, BOUNDS)
    assert aim.eye == view.eye
    assert aim.world_to_view() == pytest.approx(view.world_to_view(), abs=1e-9)
    ahead = np.array(aim.target) - np.array(aim.eye)
    past = float((BOUNDS.mean(axis=0) - np.array(aim.target)) @ ahead / np.linalg.norm(ahead))
    assert past == pytest.approx(0.0, abs=1e-9) or past < 0.0  # the middle may be behind the camera
    assert distance(aim) > 0.0


def test_an_orbit_begins_with_the_view_itself_and_closes() -> None:
    view = View(name="v", eye=(4.0, 1.0, 5.0), target=(1.0, 0.0, 0.0), up=UP, fov=30.0)
    assert orbit(view, UP, BOUNDS, 0, 8) is view
    last = orbit(view, UP, BOUNDS, 7, 8)
    assert turned(last, UP, 2.0 * np.pi / 8, 0.0).world_to_view() == pytest.approx(view.world_to_view())
    opposite = orbit(view, UP, BOUNDS, 4, 8)
    around = aimed(view, BOUNDS)
    middle = 0.5 * (np.array(view.eye) + np.array(opposite.eye))
    assert middle[[0, 2]] == pytest.approx(np.array(around.target)[[0, 2]])
