"""What depth bins say of the optical depth in front of a fragment, against what is there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from labeller import reference
from renderer import depth_bins
from renderer.depth_bins import bin_form, keep_bins, kept_room
from schemas.tail import BIN_LIMIT, BINNED_TAILS, LEAST_OTHERS, LEAST_SPREAD, OPTICAL_UNIT, TAILS, TailName

lists = st.lists(st.tuples(st.floats(0.015625, 1000.0, width=32), st.integers(0, 254)), min_size=1, max_size=40)
tails = st.sampled_from(BINNED_TAILS)
ends = st.one_of(st.none(), st.tuples(st.floats(0.015625, 1000.0, width=32), st.floats(0.015625, 1000.0, width=32)))
"""A range as it was estimated, which fragments may lie outside of; None: that of the fragments."""


def pixel_of(entries: list[tuple[float, int]], given_range: tuple[float, float] | None) -> reference.Pixel:
    depth, level = (np.array(column) for column in zip(*sorted(entries), strict=True))
    z = depth.astype(np.float32)
    low, high = (z[0], z[-1]) if given_range is None else (np.float32(each) for each in sorted(given_range))
    return reference.Pixel(
        colour=np.zeros((len(z), 3)),
        alpha=level / 255.0,
        depth=z.astype(np.float64),
        background=np.zeros(3),
        nearest=float(low),
        extent=float(high - low),
    )


def stored(pixel: reference.Pixel) -> tuple[NDArray[np.float32], NDArray[np.uint8], np.float32, np.float32]:
    """A pixel as compiled code has it."""
    rgba = np.zeros((pixel.n, 4), np.uint8)
    rgba[:, 3] = np.rint(255.0 * pixel.alpha)
    return pixel.depth.astype(np.float32), rgba, np.float32(pixel.nearest), np.float32(pixel.extent)


def optical_of(pixel: reference.Pixel) -> NDArray[np.float64]:
    return np.asarray(depth_bins.OPTICAL[np.rint(255.0 * pixel.alpha).astype(int)])


@given(lists, ends, tails)
def test_what_is_kept_is_the_plain_account_to_the_bit(
    entries: list[tuple[float, int]], given_range: tuple[float, float] | None, tail: TailName
) -> None:
    pixel, row = pixel_of(entries, given_range), TAILS[tail]
    kept = kept_room()
    units = keep_bins(bin_form(row), *stored(pixel), kept)
    plain = reference.depth_bins(pixel, optical_of(pixel), row)
    assert units == plain.units
    assert kept.front[: row.bins + 1].tolist() == plain.front.tolist()
    assert kept.mean[: row.bins].tolist() == plain.mean.tolist()


@given(lists, ends, tails)
def test_the_compiled_exponents_are_the_plain_ones(
    entries: list[tuple[float, int]], given_range: tuple[float, float] | None, tail: TailName
) -> None:
    pixel, row = pixel_of(entries, given_range), TAILS[tail]
    out = np.empty(pixel.n)
    depth_bins.binned_exponents(bin_form(row), *stored(pixel), kept_room(), out)
    np.testing.assert_allclose(out, reference.binned_exponents(pixel, optical_of(pixel), row), rtol=1e-12, atol=1e-12)


@given(lists, ends, tails)
def test_an_exponent_is_off_by_its_own_bin_and_the_steps_of_shares_at_most(
    entries: list[tuple[float, int]], given_range: tuple[float, float] | None, tail: TailName
) -> None:
    pixel, row = pixel_of(entries, given_range), TAILS[tail]
    optical = optical_of(pixel)
    found = reference.binned_exponents(pixel, optical, row)
    bins = reference.depth_bins(pixel, optical, row).bin
    # A full bin holds no more: behind it nothing is visible.
    held = np.minimum(np.bincount(bins, optical, row.bins), BIN_LIMIT / OPTICAL_UNIT)
    # A step of the shares, what whole units cannot say, and all that is in the fragment's own bin.
    step, units = held.sum() / row.share_levels, (pixel.n + 1) / OPTICAL_UNIT
    for i, b in enumerate(bins):
        before, own = held[:b].sum(), held[b]
        assert before - step - units <= found[i] <= before + own + 2.0 * step + 2.0 * units


@given(st.floats(0.015625, 1000.0, width=32), st.integers(1, 254), st.integers(1, 254), tails)
def test_of_two_fragments_the_second_is_behind_the_first_one(z: float, near: int, far: int, tail: TailName) -> None:
    pixel, row = pixel_of([(z, near), (2.0 * z, far)], None), TAILS[tail]
    optical = optical_of(pixel)
    first, second = reference.binned_exponents(pixel, optical, row)
    # A share that is kept half a step too large seems to be of others in a fragment's bin.
    step, units = (0.5 + 1e-9) * optical.sum() / row.share_levels, 2.0 / OPTICAL_UNIT * max(1.0, optical.sum())
    assert 0.0 <= first <= step + units
    assert abs(second - optical[0]) <= 2.0 * step + units


@pytest.mark.parametrize("tail", [name for name in BINNED_TAILS if TAILS[name].mean_levels])
@pytest.mark.parametrize("turned", [False, True])
def test_means_tell_two_fragments_of_a_bin_apart(tail: TailName, turned: bool) -> None:
    """Near the front of a bin or near its end: without means, half of the other is taken to be in front of each."""
    row = TAILS[tail]
    within = np.array([0.1, 0.8]) if not turned else np.array([0.2, 0.9])
    y = (1.0 + within) / row.bins
    x = np.square((np.sqrt(0.36 + 1.6 * y) - 0.6) / 0.8)  # of y = .4 x + .6 sqrt(x)
    entries = [(float(np.float32(1.0 + 8.0 * each)), 128) for each in x]
    pixel = pixel_of(entries, (1.0, 9.0))
    optical = optical_of(pixel)
    found = reference.depth_bins(pixel, optical, row)
    assert found.bin.tolist() == [1, 1]
    np.testing.assert_allclose(found.place - 1.0, within, atol=1e-4)
    first, second = reference.binned_exponents(pixel, optical, row)
    assert first == pytest.approx(0.0, abs=0.02)
    assert second == pytest.approx(optical[0], abs=0.02)


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("given_range", [(5.0, 5.0), (20.0, 30.0), (0.5, 0.75)])
def test_what_lies_outside_of_a_range_counts_as_at_its_end(tail: TailName, given_range: tuple[float, float]) -> None:
    pixel, row = pixel_of([(1.0, 100), (2.0, 50), (3.0, 200)], given_range), TAILS[tail]
    found = reference.depth_bins(pixel, optical_of(pixel), row)
    at_the_end = given_range[1] < 1.0
    assert found.bin.tolist() == [row.bins - 1 if at_the_end else 0] * 3
    assert found.place.tolist() == [row.bins if at_the_end else 0.0] * 3


def test_no_stored_alpha_is_near_half_a_unit() -> None:
    units = depth_bins.OPTICAL[1:255] * OPTICAL_UNIT
    # A float32 logarithm is off by less than 1e-6 of itself: of 1,401 units, by a thousandth and a half.
    assert np.abs(units - np.floor(units) - 0.5).min() > 0.004
    assert (depth_bins.UNITS[1:] >= 1.0).all()
    assert depth_bins.UNITS[0] == 0.0


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_a_full_bin_stays_full(tail: TailName) -> None:
    entries, row = [(2.0, 254)] * 4096, TAILS[tail]
    pixel = pixel_of(entries, None)
    kept = kept_room()
    assert keep_bins(bin_form(row), *stored(pixel), kept) == BIN_LIMIT
    assert kept.front[: row.bins + 1].tolist() == [0.0, *[1.0] * row.bins]
    assert reference.depth_bins(pixel, optical_of(pixel), row).units == BIN_LIMIT


def test_what_a_mean_of_others_needs_is_far_below_a_stored_fragment() -> None:
    assert depth_bins.OPTICAL[1] > LEAST_OTHERS
    assert 0.0 < LEAST_SPREAD < 0.5 / max(row.mean_levels or 1 for row in TAILS.values())
