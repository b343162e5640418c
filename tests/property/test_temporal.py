"""What a pixel remembers between frames, in float64: bounded and finite whatever was seen, and nearer to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from renderer.allocation.prices import LEAST_PRICE, PRICE_STEPS, RANKS
from renderer.reference import temporal
from renderer.techniques.kbuffer_temporal import FRAMES, MOVING_FRAMES, SEEN_LEAST, SEEN_STEPS, is_cut
from schemas.view import View

GAINS = st.sampled_from([0.0, 1e-300, 1e-12, 1e-3, 1.0, 3.0, np.inf, -np.inf, np.nan])
WORDS = st.integers(0, 2**32 - 1)


def seen(gain: float, cut: int = 1, n: int = 4) -> temporal.Remembered:
    """One pixel that has seen a picture whose red, as it is displayed, its last core bin changed by sqrt(gain)."""
    is_open = np.ones(1, dtype=bool)
    _, before = temporal.corrected(temporal.nothing(1), ranks(), np.array([n]), is_open, still=True)
    dark, lit = np.zeros((1, 3)), np.zeros((1, 3))
    lit[0, 0] = gain
    return temporal.observed(before, np.array([cut]), np.ones(1, int), lit, dark)


def ranks(*first: int) -> np.ndarray:
    """int [1, 12], ranks of one pixel, the last of these for all bins that follow."""
    known = first or (100,)
    return np.array([[*known, *[known[-1]] * (12 - len(known))]])


@given(gain=GAINS)
def test_whatever_is_seen_is_a_number(gain: float) -> None:
    code = int(seen(gain).seen[0])
    assert 0 <= code <= int((np.log(1.01) - SEEN_LEAST) * SEEN_STEPS)
    assert (code == 0) == (not gain > 1e-12)


@given(
    words=st.lists(WORDS, min_size=1, max_size=20),
    predicted=st.lists(st.integers(0, RANKS - 1), min_size=12, max_size=12).map(sorted),
    n=st.integers(2, 5000),
    still=st.booleans(),
)
def test_corrections_are_bounded_whatever_is_remembered(
    words: list[int], predicted: list[int], n: int, still: bool
) -> None:
    size, before = len(words), temporal.unpacked(np.array(words, dtype=np.uint32))
    made, after = temporal.corrected(
        before, np.tile(predicted, (size, 1)), np.full(size, n), np.ones(size, dtype=bool), still
    )
    assert ((made >= 0) & (made < RANKS)).all()
    assert (np.diff(made, axis=1) >= 0).all()
    assert np.abs(after.correction).max() <= max(temporal.LARGEST, int(np.abs(before.correction).max()))
    assert after.frames.max() <= (FRAMES if still else MOVING_FRAMES)
    assert (after.frames >= np.minimum(before.frames, MOVING_FRAMES) * (after.frames > 0)).all()


@given(
    gain=st.floats(1e-9, 1.0),
    predicted=st.lists(st.integers(30, 220), min_size=12, max_size=12),
    cut=st.integers(1, 12),
)
def test_a_price_comes_nearer_to_what_was_seen_and_not_beyond(gain: float, predicted: list[int], cut: int) -> None:
    before, own = seen(gain, cut, n=63), np.array([sorted(predicted)])
    truth = before.seen[0] / SEEN_STEPS + SEEN_LEAST
    made, _ = temporal.corrected(before, own, np.array([63]), np.ones(1, dtype=bool), still=True)
    wrong, left = (truth + LEAST_PRICE + each[0, cut - 1] / PRICE_STEPS for each in (own, made))
    assert abs(left) <= abs(wrong) + 0.5 / PRICE_STEPS
    assert left * wrong >= -0.5 / PRICE_STEPS * abs(wrong)


@pytest.mark.parametrize(
    ("n", "after", "kept"), [(4, 4, True), (4, 5, False), (16, 18, True), (16, 19, False), (80, 5000, True)]
)
def test_a_pixel_that_shows_something_else_forgets(n: int, after: int, kept: bool) -> None:
    is_open = np.ones(1, dtype=bool)
    made, memory = temporal.corrected(seen(1.0, n=n), ranks(100, 120), np.array([after]), is_open, still=False)
    assert (memory.correction[0] > 0) == kept
    assert (made[0, 0] < 100) == (made[0, 1] < 120) == kept
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
    is_open = np.ones(1, dtype=bool)
    memory, steps = seen(1e-12), []
    for _ in range(FRAMES + 2):
        made, after = temporal.corrected(memory, ranks(20, 200), np.array([4]), is_open, still=True)
        steps.append(int(memory.correction[0] - after.correction[0]))
        memory = temporal.observed(after, np.ones(1, int), np.ones(1, int), np.zeros((1, 3)), np.zeros((1, 3)))
        assert made[0, :2].tolist() == [20 - after.correction[0], min(200 - after.correction[0], RANKS - 1)]
    assert steps[0] == 12
    assert steps == sorted(steps, reverse=True)
    assert steps[-2:] == [0, 0]
    assert steps[FRAMES - 1] > 0
