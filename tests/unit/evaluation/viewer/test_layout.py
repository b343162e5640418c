"""Compositions of two small pictures, pixel by pixel."""

from __future__ import annotations

import numpy as np
import pytest

from evaluation.report.colours import COUNT, HEAT, apply
from evaluation.viewer.layout import DIVIDER, LAYOUTS, Layout, Pane, across, blank, compose, difference

RNG = np.random.default_rng(4)
LEFT = Pane(RNG.integers(0, 256, (6, 10, 3)).astype(np.uint8), RNG.integers(0, 9, (6, 10)).astype(np.int32))
RIGHT = Pane(RNG.integers(0, 256, (6, 10, 3)).astype(np.uint8), RNG.integers(0, 30, (6, 10)).astype(np.int32))


def composed(layout: Layout, split: float = 0.4, gain: float = 4.0, top: int = 8) -> np.ndarray:
    return compose(layout, LEFT, RIGHT, split, gain, top)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_it_is_as_wide_as_its_panes_and_leaves_them_alone(layout: Layout) -> None:
    before = LEFT.image.copy(), RIGHT.image.copy()
    image = composed(layout)
    assert image.shape == (6, 10 * across(layout), 3)
    assert image.dtype == np.uint8
    assert np.array_equal(before[0], LEFT.image)
    assert np.array_equal(before[1], RIGHT.image)


def test_single_and_side_by_side_are_the_pictures_themselves() -> None:
    assert np.array_equal(composed("single"), LEFT.image)
    both = composed("side-by-side")
    assert np.array_equal(both[:, :10], LEFT.image)
    assert np.array_equal(both[:, 10:], RIGHT.image)


def test_the_divider_is_a_line_between_left_and_right() -> None:
    image = composed("split")
    assert np.array_equal(image[:, :4], LEFT.image[:, :4])
    assert (image[:, 4] == DIVIDER).all()
    assert np.array_equal(image[:, 5:], RIGHT.image[:, 5:])
    assert np.array_equal(composed("split", split=0.0), RIGHT.image)
    assert np.array_equal(composed("split", split=1.0), LEFT.image)


def test_the_difference_is_that_of_the_channel_that_differs_most_amplified() -> None:
    one, other = np.zeros((1, 3, 3), np.uint8), np.zeros((1, 3, 3), np.uint8)
    other[0, 1] = (10, 30, 20)
    one[0, 2] = (200, 0, 0)
    assert difference(one, other) * 255.0 == pytest.approx(np.array([[0.0, 30.0, 200.0]]))
    panes = Pane(one, LEFT.k[:1, :3]), Pane(other, LEFT.k[:1, :3])
    image = compose("difference", *panes, split=0.5, gain=4.0, top=1)
    assert np.array_equal(image, apply(np.array([[0.0, 120.0 / 255.0, 1.0]]), HEAT))


def test_both_heat_maps_of_k_have_one_scale() -> None:
    image = composed("k")
    assert np.array_equal(image[:, :10], apply(LEFT.k / 8, COUNT))
    assert np.array_equal(image[:, 10:], apply(np.minimum(RIGHT.k, 8) / 8, COUNT))


def test_where_there_is_no_picture_there_is_grey() -> None:
    pane = blank(7, 5)
    assert pane.image.shape == (5, 7, 3)
    assert len(np.unique(pane.image)) == 1
    assert not pane.k.any()
