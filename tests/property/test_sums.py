"""Invariants of the techniques that blend into sums, on their float64 twins and random lists."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.dumps import dump_of

from renderer.reference import moment, stochastic, wavelet, weighted_average, weighted_blended
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump

Picture = Callable[[FragmentDump], NDArray[np.float64]]
List = tuple[NDArray[np.uint8], NDArray[np.float32]]

PICTURES: dict[str, Picture] = {
    "weighted-average": weighted_average.picture,
    "weighted-blended": lambda dump: weighted_blended.picture(dump, 0.5, 600.0),
    "moment": moment.picture,
    "stochastic": stochastic.picture,
    "wavelet": wavelet.picture,
}
EXACT_COVERAGE = ["weighted-blended", "moment", "stochastic", "wavelet"]

every = pytest.mark.parametrize("name", PICTURES)


@st.composite
def lists(draw: st.DrawFn, least: int = 1, most: int = 12, kinds: int = 4) -> List:
    """Fragments front to back; ties, near ties and distances of 1 to 500."""
    n = draw(st.integers(least, most))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    rgba = rng.integers(0, 256, (n, 4)).astype(np.uint8)
    rgba[:, 3] = rng.integers(1, 255, n)
    depth = [
        rng.integers(1, 4, n),
        rng.uniform(1.0, 5.0, n),
        np.exp(rng.uniform(0.0, 6.2, n)),
        3.0 + 1e-5 * rng.random(n),
    ][draw(st.integers(0, kinds - 1))]
    return rgba, np.sort(depth).astype(np.float32)


def composite(fragments: List, behind: NDArray[np.float64]) -> NDArray[np.float64]:
    """The exact colour, float64 [3]."""
    through, colour = 1.0, np.zeros(3)
    for r, g, b, a in fragments[0]:
        colour += through * a / 255.0 * decode_gamma2(np.array([r, g, b], np.uint8))
        through *= 1.0 - a / 255.0
    return colour + through * behind


@every
@given(lists(most=1))
def test_one_fragment_is_exact(name: str, fragments: List) -> None:
    dump = dump_of([fragments], background=(10, 200, 90))
    expected = composite(fragments, decode_gamma2(dump.background[0]))
    np.testing.assert_allclose(PICTURES[name](dump)[0], expected, atol=1e-12)


@every
@given(lists(), st.integers(0, 2**16))
def test_the_order_of_arrival_does_not_matter(name: str, fragments: List, seed: int) -> None:
    order = np.random.default_rng(seed).permutation(len(fragments[1]))
    shuffled = fragments[0][order], fragments[1][order]
    np.testing.assert_allclose(PICTURES[name](dump_of([shuffled])), PICTURES[name](dump_of([fragments])), atol=1e-7)


@every
@given(lists())
def test_a_colour_is_a_mixture_of_what_is_there(name: str, fragments: List) -> None:
    dump = dump_of([fragments], background=(90, 0, 255))
    there = np.concatenate([decode_gamma2(dump.rgba[:, :3]), decode_gamma2(dump.background)])
    colour = PICTURES[name](dump)[0]
    assert (colour >= there.min(axis=0) - 1e-12).all()
    assert (colour <= there.max(axis=0) + 1e-12).all()


@pytest.mark.parametrize("name", EXACT_COVERAGE)
@given(lists())
def test_fragments_of_one_colour_are_exact(name: str, fragments: List) -> None:
    fragments[0][:, :3] = (200, 30, 120)
    dump = dump_of([fragments], background=(0, 255, 60))
    expected = composite(fragments, decode_gamma2(dump.background[0]))
    np.testing.assert_allclose(PICTURES[name](dump)[0], expected, atol=1e-12)


@given(lists())
def test_the_plain_average_never_covers_more_than_there_is(fragments: List) -> None:
    fragments[0][:, :3] = 0
    seen = weighted_average.picture(dump_of([fragments], background=(255, 255, 255)))[0, 0]
    assert seen >= np.prod(1.0 - fragments[0][:, 3] / 255.0) - 1e-12


@pytest.mark.parametrize("name", ["weighted-average", "moment"])
@given(lists())
def test_faint_fragments_are_exact_to_second_order(name: str, fragments: List) -> None:
    fragments[0][:, 3] = 1
    dump = dump_of([fragments])
    error = np.abs(PICTURES[name](dump)[0] - composite(fragments, np.ones(3))).max()
    assert error <= (len(fragments[1]) / 255.0) ** 2


@given(lists(), st.integers(7, 10), st.floats(1e-6, 1e6))
def test_weights_do_not_know_units_and_fall_with_depth(fragments: List, equation: int, scale: float) -> None:
    depth, alpha = fragments[1].astype(np.float64), np.ones(len(fragments[1]))
    weights = weighted_blended.weights(depth, alpha, 0.5, 600.0, equation)
    scaled = weighted_blended.weights(scale * depth, alpha, scale * 0.5, scale * 600.0, equation)
    np.testing.assert_allclose(scaled, weights, rtol=1e-9)
    assert (np.diff(weights) <= 0.0).all()
    assert weights.min() >= 1e-2


@given(lists(kinds=3))
def test_moments_bound_the_true_transmittance(fragments: List) -> None:
    """Markov and Chebyshev: the points' own mass is what a representation cannot place. The bias adds its own mass."""
    absorbance = -np.log1p(-fragments[0][:, 3] / 255.0)
    x = moment.warped(fragments[1])
    nearer = np.array([absorbance[x < at].sum() for at in x]) / absorbance.sum()
    reached = np.array([absorbance[x <= at].sum() for at in x]) / absorbance.sum()
    slack = moment.BIAS + 1e-7
    assert (moment.share_before(absorbance, x, overestimation=0.0) <= nearer + slack).all()
    assert (moment.share_before(absorbance, x, overestimation=1.0) >= reached - slack).all()


@given(lists(most=3, kinds=3))
def test_moments_know_up_to_three_fragments(fragments: List) -> None:
    _, depth = fragments
    if len(depth) > 1 and np.diff(np.log(depth)).min() <= 0.05 * np.log(depth[-1] / depth[0]):
        return  # closer than the bias tells apart, or tied
    absorbance = -np.log1p(-fragments[0][:, 3] / 255.0)
    nearer = (np.cumsum(absorbance) - absorbance) / absorbance.sum()
    found = moment.share_before(absorbance, moment.warped(depth), bias=1e-9, overestimation=0.0)
    np.testing.assert_allclose(found, nearer, atol=1e-3)


@given(lists(), st.integers(1, 32), st.integers(0, 2**32 - 1))
def test_a_fragment_covers_as_many_samples_as_its_opacity_says(fragments: List, samples: int, seed: int) -> None:
    rgba, depth = fragments
    covered = stochastic.coverage(np.full(len(depth), 3), depth, rgba.view("<u4")[:, 0], samples, seed)
    assert (np.abs(covered.sum(axis=1) - rgba[:, 3] / 255.0 * samples) < 1.0).all()
    assert (stochastic.visibility(depth, covered)[depth == depth[0]] == 1.0).all()


def test_visibility_is_right_on_average() -> None:
    """A z-test: the mean over pixels lies within 4.5 standard errors of the transmittance."""
    alpha = np.array([40, 130, 9, 200, 90])
    rgba = np.array([(50, 60, 70, a) for a in alpha], np.uint8)
    depth = np.array([1.0, 1.5, 2.0, 2.25, 7.0], np.float32)
    pixels = 4000
    packed = np.tile(rgba.view("<u4")[:, 0], pixels)
    covered = stochastic.coverage(np.repeat(np.arange(pixels), 5), np.tile(depth, pixels), packed, 8, seed=1)
    seen = np.array([stochastic.visibility(depth, mask) for mask in covered.reshape(pixels, 5, 8)])
    expected = np.cumprod(np.concatenate([[1.0], 1.0 - alpha[:-1] / 255.0]))
    error = np.abs(seen.mean(axis=0) - expected)
    assert (error <= 4.5 * seen.std(axis=0) / np.sqrt(pixels) + 1e-12).all()


def test_every_sample_is_covered_equally_often() -> None:
    pixels, alpha = 8000, 77 / 255.0
    packed = np.full(pixels, 77 << 24 | 0x030201, np.uint32)
    masks = stochastic.coverage(np.arange(pixels), np.ones(pixels, np.float32), packed, 8, 0)
    assert (np.abs(masks.mean(axis=0) - alpha) < 4.5 * np.sqrt(alpha * (1.0 - alpha) / pixels)).all()
