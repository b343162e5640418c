"""What the judge calls equal, explained and different."""

from __future__ import annotations

import numpy as np

from benchmarks.judging.agreement import Agreement, look_agreement, shape_agreement
from benchmarks.judging.seen import Seen

SIZE = 9


def square(shift: int = 0, depth: float = 2.0, colour: tuple[float, ...] = (0.5, 0.2, 0.1), alpha: float = 1.0) -> Seen:
    """A square of 4x4 pixels, `shift` pixels to the right."""
    rgba = np.zeros((SIZE, SIZE, 4), np.float32)
    depths = np.full((SIZE, SIZE), np.inf, np.float32)
    place = np.s_[2:6, 2 + shift : 6 + shift]
    rgba[place] = (*(alpha * value for value in colour), alpha)
    if alpha == 1.0:
        depths[place] = depth
    return Seen(rgba, depths)


def shapes(here: Seen, there: Seen) -> Agreement:
    return shape_agreement(here, there, 10.0, (1.0, 10.0))


def test_the_same_shape_agrees_in_every_pixel() -> None:
    found = shapes(square(), square())
    assert [(count.pixels, count.equal) for count in found.counts.values()] == [(16, 16), (16, 16)]
    assert not found.wrong.any()


def test_an_edge_off_by_a_pixel_is_explained_and_one_off_by_two_is_not() -> None:
    near, far = (shapes(square(), square(shift)).counts["silhouette"] for shift in (1, 2))
    assert (near.equal, near.edge, near.unexplained) == (12, 8, 0)
    assert (far.edge, far.unexplained) == (4, 12)  # those are beside corners


def test_another_depth_is_unexplained_beyond_the_tolerance() -> None:
    assert shapes(square(), square(depth=2.001)).counts["depth"].unexplained == 0

    assert shapes(square(), square(depth=2.01)).counts["depth"].unexplained == 16


def test_another_colour_and_another_opacity_are_told_apart() -> None:
    colour = look_agreement(square(), square(colour=(0.5, 0.3, 0.1))).counts
    assert colour["colour"].unexplained > 0
    assert colour["opacity"].unexplained == 0
    opacity = look_agreement(square(alpha=0.5), square(alpha=0.4)).counts
    assert opacity["opacity"].unexplained > 0


def test_what_has_no_colour_is_grey_in_either() -> None:
    grey, storms = square(colour=(0.7, 0.7, 0.7)), square(colour=(0.5, 0.5, 0.5))
    colour = look_agreement(grey, storms).counts["colour"]
    assert (colour.unset > 0, colour.unexplained) == (True, 0)
    assert look_agreement(storms, grey).counts["colour"].unexplained > 0
