"""What a pixel remembers between frames, in float64: bounded and finite whatever was seen, and nearer to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.reference import temporal
from renderer.techniques.kbuffer_temporal import (
    CORRECTION_STEPS,
    FRAMES,
    MOVING_FRAMES,
    SEEN_LEAST,
    SEEN_STEPS,
    is_cut,
)
from schemas.view import View

GAINS = st.sampled_from([0.0, 1e-300, 1e-12, 1e-3, 1.0, 3.0, np.inf, -np.inf, np.nan])
WORDS = st.integers(0, 2**32 - 1)


def seen(gain: float, k: int = 1, n: int = 4) -> temporal.Remembered:
    """One pixel that has seen a picture whose red, as it is displayed, a last fragment changed by sqrt(gain)."""
    one, is_open = np.ones(1), np.ones(1, dtype=bool)
    _, before = temporal.corrected(temporal.nothing(1), one, one, np.array([n]), is_open, still=True)
    dark, lit = np.zeros((1, 3)), np.zeros((1, 3))
    lit[0, 0] = gain
    return temporal.observed(before, np.array([k]), lit, dark)


@given(gain=GAINS)
def test_whatever_is_seen_is_a_number(gain: float) -> None:
    code = int(seen(gain).seen[0])
    assert 0 <= code <= int((np.log(1.01) - SEEN_LEAST) * SEEN_STEPS)
    assert (code == 0) == (not gain > 1e-12)


@given(
    words=st.lists(WORDS, min_size=1, max_size=20),
    a=st.floats(-(2.0**100), 2.0**100),
    b=st.floats(2.0**-12, 2.0**98),
    n=st.integers(2, 5000),
    still=st.booleans(),
)
def test_corrections_are_bounded_whatever_is_remembered(
    words: list[int], a: float, b: float, n: int, still: bool
) -> None:
    size, before = len(words), temporal.unpacked(np.array(words, dtype=np.uint32))
    made, after = temporal.corrected(
        before, np.full(size, a), np.full(size, b), np.full(size, n), np.ones(size, dtype=bool), still
    )
    assert np.isfinite(made).all()
    assert np.abs(after.correction).max() <= max(temporal.LARGEST, int(np.abs(before.correction).max()))
    assert after.frames.max() <= (FRAMES if still else MOVING_FRAMES)
    assert (after.frames >= np.minimum(before.frames, MOVING_FRAMES) * (after.frames > 0)).all()


@given(gain=st.floats(1e-9, 1.0), a=st.floats(-20.0, 2.0), b=st.floats(0.1, 3.0), k=st.integers(1, 63))
def test_a_curve_comes_nearer_to_what_was_seen_and_not_beyond(gain: float, a: float, b: float, k: int) -> None:
    before = seen(gain, k, n=63)
    truth = before.seen[0] / SEEN_STEPS + SEEN_LEAST
    pixel, is_open = np.ones(1), np.ones(1, dtype=bool)
    made, _ = temporal.corrected(before, a * pixel, b * pixel, np.array([63]), is_open, still=True)
    wrong, left = truth - (a - b * (k - 1)), truth - (made[0] - b * (k - 1))
    assert abs(left) <= abs(wrong) + 0.5 / CORRECTION_STEPS
    assert left * wrong >= -0.5 / CORRECTION_STEPS * abs(wrong)


@pytest.mark.parametrize(
    ("n", "after", "kept"), [(4, 4, True), (4, 5, False), (16, 18, True), (16, 19, False), (80, 5000, True)]
)
def test_a_pixel_that_shows_something_else_forgets(n: int, after: int, kept: bool) -> None:
    pixel, is_open = np.ones(1), np.ones(1, dtype=bool)
    made, memory = temporal.corrected(seen(1.0, n=n), -9.0 * pixel, pixel, np.array([after]), is_open, still=False)
    assert (memory.correction[0] > 0) == kept
    assert (made[0] > -9.0) == kept
    assert memory.frames[0] == int(kept)


@pytest.mark.parametrize(
    ("change", "cut"),
    [
        ({}, False),
        ({"name": "another name"}, False),
        ({"eye": (10.0 * np.sin(np.radians(5.9)), 0.0, 10.0 * np.cos(np.radians(5.9)))}, False),
        ({"eye": (10.0 * np.sin(np.radians(6.1)), 0.0, 10.0 * np.cos(np.radians(6.1)))}, True),
        ({"eye": (0.0, 0.0, 14.9)}, False),
        ({"eye": (0.0, 0.0, 15.1)}, True),
        ({"target": (1.0, 0.0, 0.0)}, False),
        ({"target": (1.1, 0.0, 0.0)}, True),
        ({"up": (0.2, 1.0, 0.0)}, True),
        ({"fov": 44.0}, True),
        ({"ortho_height": 2.0}, True),
        ({"shift": (0.1, 0.0)}, True),
    ],
)
def test_a_camera_that_is_elsewhere_is_a_cut(change: dict[str, object], cut: bool) -> None:
    view = View(name="front", eye=(0.0, 0.0, 10.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
    assert is_cut(view, view.model_copy(update=change), extent=100.0) == cut


def test_steps_become_smaller_and_stop() -> None:
    pixel, is_open = np.ones(1), np.ones(1, dtype=bool)
    memory, steps = seen(1e-12), []
    for _ in range(FRAMES + 2):
        made, after = temporal.corrected(memory, 5.0 * pixel, pixel, np.array([4]), is_open, still=True)
        steps.append(int(memory.correction[0] - after.correction[0]))
        memory = temporal.observed(after, np.array([1]), np.zeros((1, 3)), np.zeros((1, 3)))
        assert made[0] == 5.0 + after.correction[0] / CORRECTION_STEPS
    assert steps[0] == 24
    assert steps == sorted(steps, reverse=True)
    assert steps[-2:] == [0, 0]
    assert steps[FRAMES - 1] > 0
