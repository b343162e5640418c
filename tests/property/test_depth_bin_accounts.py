"""What depth bins say of the optical depth in front of a fragment, against what is there."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from labeller.reference import binned_exponents
from renderer import depth_bins
from schemas.tail import BIN_LIMIT, DENSITY_BINS, OPTICAL_UNIT, SHARE_LEVELS

lists = st.lists(st.tuples(st.floats(0.015625, 1000.0, width=32), st.integers(0, 254)), min_size=1, max_size=40)
bins = st.sampled_from(sorted(DENSITY_BINS.values()))


def _sorted(entries: list[tuple[float, int]]) -> tuple[np.ndarray, np.ndarray]:
    depth, level = (np.array(column) for column in zip(*sorted(entries), strict=True))
    return depth.astype(np.float32), level.astype(np.uint8)


@given(lists, bins)
def test_the_compiled_account_is_the_plain_one(entries: list[tuple[float, int]], count: int) -> None:
    depth, level = _sorted(entries)
    rgba = np.zeros((len(level), 4), np.uint8)
    rgba[:, 3] = level
    optical = depth_bins.OPTICAL[level]
    out = np.empty(len(level))
    depth_bins.binned_exponents(depth, rgba, float(optical.sum()), np.empty(count + 1), out)
    np.testing.assert_allclose(out, binned_exponents(depth.astype(np.float64), optical, count), rtol=1e-12, atol=1e-12)


@given(lists, bins)
def test_an_exponent_is_off_by_its_own_bin_and_the_steps_of_shares_at_most(
    entries: list[tuple[float, int]], count: int
) -> None:
    depth, level = _sorted(entries)
    optical = depth_bins.OPTICAL[level]
    found = binned_exponents(depth.astype(np.float64), optical, count)
    extent = depth[-1] - depth[0]
    place = np.array([min(int(depth_bins.place_of(z, depth[0], extent, count)), count - 1) for z in depth])
    # A step of the shares, what whole units cannot say, and all that is in the fragment's own bin.
    step = optical.sum() / SHARE_LEVELS
    units = (len(level) + 1) / OPTICAL_UNIT
    for i, b in enumerate(place):
        before, own = optical[place < b].sum(), optical[place == b].sum()
        assert before - step - units <= found[i] <= before + own + 2.0 * step + 2.0 * units


@given(st.floats(0.015625, 1000.0, width=32), st.integers(1, 254), st.integers(1, 254), bins)
def test_of_two_fragments_the_second_is_behind_the_first_one(z: float, near: int, far: int, count: int) -> None:
    optical = depth_bins.OPTICAL[[near, far]]
    first, second = binned_exponents(np.array([z, 2.0 * z]), optical, count)
    assert first == 0.0
    assert abs(second - optical[0]) <= (0.5 + 1e-9) * optical.sum() / SHARE_LEVELS + 2.0 / OPTICAL_UNIT * optical.sum()


def test_no_stored_alpha_is_near_half_a_unit() -> None:
    units = depth_bins.OPTICAL[1:255] * OPTICAL_UNIT
    assert np.abs(units - np.floor(units) - 0.5).min() > 0.01
    assert (depth_bins.UNITS[1:] >= 1.0).all()
    assert depth_bins.UNITS[0] == 0.0


def test_a_full_bin_stays_full() -> None:
    n = 4096
    rgba = np.full((n, 4), 254, np.uint8)
    front = np.empty(9)
    depth_bins.units_in_front(np.full(n, 2.0, np.float32), rgba, front)
    assert front.tolist() == [0.0, *[BIN_LIMIT] * 8]
