"""What the exact techniques promise for any list of fragments, on their float64 twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dumps import dump_of

from renderer.reference import depth_peeling, dual_depth_peeling, exact
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump

BACKGROUND = (200, 120, 40)
Fragment = tuple[float, tuple[int, int, int, int]]

# Few depths and colours, so that ties and equal fragments are usual.
colours = st.tuples(*[st.sampled_from([0, 1, 128, 255])] * 3, st.sampled_from([1, 2, 128, 254]))
depths = st.sampled_from([0.5, 1.0, 1.0000001, 2.0, 1e5])
fragments = st.lists(st.tuples(depths, colours), max_size=12)
twins = pytest.mark.parametrize("twin", [exact, depth_peeling, dual_depth_peeling], ids=lambda twin: twin.__name__)


def pixel(listed: list[Fragment]) -> FragmentDump:
    rgba = np.array([colour for _, colour in listed], np.uint8).reshape(-1, 4)
    return dump_of([(rgba, np.array([depth for depth, _ in listed], np.float32))], BACKGROUND)


@twins
@given(fragments, st.randoms(use_true_random=False))
def test_the_order_of_arrival_makes_no_difference(twin: object, listed: list[Fragment], random: object) -> None:
    shuffled = list(listed)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    assert np.array_equal(picture(twin, listed), picture(twin, shuffled))


@twins
@given(fragments)
def test_every_way_is_the_composite_in_order(twin: object, listed: list[Fragment]) -> None:
    ordered = sorted((np.float32(depth), rgba[::-1]) for depth, rgba in listed)
    colour, through = np.zeros(3), 1.0
    for _, (alpha, blue, green, red) in ordered:
        colour += through * alpha / 255.0 * decode_gamma2(np.array([red, green, blue], np.uint8))
        through *= 1.0 - alpha / 255.0
    colour += through * decode_gamma2(np.array(BACKGROUND, np.uint8))
    np.testing.assert_allclose(picture(twin, listed), colour, atol=1e-14)


@twins
@given(fragments)
def test_a_picture_lies_between_its_darkest_and_brightest_colour(twin: object, listed: list[Fragment]) -> None:
    stored = np.array([colour[:3] for _, colour in listed] + [BACKGROUND], np.uint8)
    linear = decode_gamma2(stored)
    seen = picture(twin, listed)
    assert (seen >= linear.min(axis=0) - 1e-12).all()
    assert (seen <= linear.max(axis=0) + 1e-12).all()


@twins
def test_nothing_shows_the_background_and_one_fragment_is_blended_over_it(twin: object) -> None:
    background = decode_gamma2(np.array(BACKGROUND, np.uint8))
    assert np.array_equal(picture(twin, []), background)
    np.testing.assert_allclose(picture(twin, [(1.0, (255, 0, 0, 51))]), 0.8 * background + [0.2, 0, 0], atol=1e-15)


def picture(twin: object, listed: list[Fragment]) -> np.ndarray:
    made: np.ndarray = twin.picture(pixel(listed))[0]  # type: ignore[attr-defined]
    return made
