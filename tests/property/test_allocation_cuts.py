"""Whole bins within a budget: against a plain loop over events, and what must hold whatever a network answers."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from renderer.allocation.cuts import (
    DROPPED_BITS,
    FULL,
    LEAST_FALL,
    LEAST_PRICE,
    MOST_CORE,
    MOST_FALL,
    MOST_GAIN,
    RANKS,
    Cuts,
    events_of,
    importance_curve,
    rank_of,
    solve_cuts,
    usable_counts,
    within_limits,
)
from renderer.allocation.fill import solve_lambda
from schemas.bundle import GAIN_FLOOR

pytestmark = pytest.mark.usefixtures("single_thread")

NAN, INF = float("nan"), float("inf")
gain = st.one_of(st.sampled_from([0.0, -8.0, -1e30, 1e30, NAN, INF, -INF]), st.floats(-200.0, 200.0, width=32))
fall = st.one_of(st.sampled_from([0.5, GAIN_FLOOR, 1e30, NAN, INF]), st.floats(0.03125, 300.0, width=32))
count = st.one_of(st.integers(0, 4), st.sampled_from([0, 1, 40, FULL - 1, FULL]))


@st.composite
def frames(draw: st.DrawFn) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64], int]:
    """Curves, counts by bin, and a budget, often one on an edge; all pixels are alike at times."""
    pixels, bins = draw(st.integers(1, 8)), draw(st.sampled_from([4, 8, 12]))
    counts = np.array(draw(st.lists(st.lists(count, min_size=bins, max_size=bins), min_size=pixels, max_size=pixels)))
    a, b = (np.array([draw(each) for _ in range(pixels)], dtype=np.float32) for each in (gain, fall))
    if draw(st.booleans()):
        a, b = np.full(pixels, a[0]), np.full(pixels, b[0])
    total = int(usable_counts(counts).sum())
    edges = {0, 1, max(total - 1, 0), total, 2 * total}
    return a, b, counts, draw(st.one_of(st.sampled_from(sorted(edges)), st.integers(0, total + 1)))


def plain_rank(a: np.float32, b: np.float32, before: int, after: int) -> int:
    """Rank of one price, spelled out: the upper bits of the float32 number that it is above the least price."""
    price = np.float32(b * np.float32(np.float32(0.5 * (before + after)) - np.float32(1.0))) - a
    above = max(np.float32(price - np.float32(LEAST_PRICE)), np.float32(1.0))
    (bits,), (one,) = (struct.unpack("<I", struct.pack("<f", number)) for number in (above, 1.0))
    return min(int(bits - one) >> DROPPED_BITS, RANKS - 1)


def plain_cuts(
    a: NDArray[np.float32], b: NDArray[np.float32], counts: NDArray[np.integer], budget: int
) -> tuple[list[int], list[int]]:
    """Cuts and k of all pixels: events one by one, by rising rank, then pixel and bin, until one no longer fits."""
    gains, falls = within_limits(a, b)
    events: dict[int, list[tuple[int, int, int]]] = {}
    for p, row in enumerate(counts.tolist()):
        before = 0
        for bin_, own in enumerate(row):
            if own >= FULL or before + own > MOST_CORE:
                break
            if own:
                rank = plain_rank(gains[p], falls[p], before, before + own)
                events.setdefault(rank, []).append((p, bin_, own))
            before += own
    cut, k, spent = [0] * len(a), [0] * len(a), 0
    for rank in sorted(events):
        for p, bin_, own in sorted(events[rank]):
            if spent + own > budget:
                return cut, k
            cut[p], k[p], spent = bin_ + 1, k[p] + own, spent + own
    return cut, k


def solve(a: NDArray[np.floating], b: NDArray[np.floating], counts: NDArray[np.integer], budget: int) -> Cuts:
    return solve_cuts(events_of(a, b, counts), budget)


@settings(max_examples=400)
@given(frames())
def test_cuts_are_those_of_the_plain_loop(
    frame: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64], int],
) -> None:
    a, b, counts, budget = frame
    found = solve(a, b, counts, budget)
    cut, k = plain_cuts(a, b, counts, budget)
    assert found.cut.tolist() == cut
    assert found.k.tolist() == k


@settings(max_examples=300)
@given(frames())
def test_a_budget_is_met_up_to_one_bin_of_one_pixel(
    frame: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64], int],
) -> None:
    a, b, counts, budget = frame
    usable, found = usable_counts(counts), solve(a, b, counts, budget)
    assert found.k.sum() <= budget
    bins = np.arange(counts.shape[1])
    assert np.array_equal(found.k, np.where(bins < found.cut[:, None], usable, 0).sum(axis=1))
    if found.rank is None:
        assert np.array_equal(found.k, usable.sum(axis=1))
        return
    # Some pixel's next bin does not fit any more.
    waiting = np.where((bins >= found.cut[:, None]) & (usable > 0), usable, 0)
    following = [row[row > 0][0] for row in waiting if row.any()]
    assert budget - found.k.sum() < max(following)


@given(frames())
def test_what_a_price_grants_is_granted_at_any_greater_budget(
    frame: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64], int],
) -> None:
    a, b, counts, budget = frame
    less, more = (solve(a, b, counts, each) for each in (budget, budget + 7))
    assert more.rank is None or (less.rank is not None and less.rank <= more.rank)
    # Of the pixels that grow at one price the first ones by index do: more of them for a greater budget.
    assert (more.cut >= less.cut).all()


@given(gain, fall, st.lists(st.integers(0, 60), min_size=4, max_size=12))
def test_ranks_rise_from_bin_to_bin(a: float, b: float, row: list[int]) -> None:
    events = events_of(np.array([a]), np.array([b]), np.array([row]))
    ranks = events.rank[events.growth > 0]
    assert (np.diff(ranks) >= 0).all()
    assert ((ranks >= 0) & (ranks <= RANKS - 1)).all()


@given(st.floats(width=32, allow_nan=False), st.floats(width=32, allow_nan=False))
def test_ranks_do_not_fall_as_prices_rise(one: float, other: float) -> None:
    low, high = sorted((one, other))
    ranks = rank_of(np.array([low, high], dtype=np.float32))
    assert ranks[0] <= ranks[1]
    if low > LEAST_PRICE + 1.0 and high < 60_000.0 and high - low > 2.0**-8 * (high - LEAST_PRICE):
        assert ranks[0] < ranks[1], "those around 10 are told from each other if they are 1/14 apart"


@given(st.lists(count, min_size=4, max_size=16))
def test_bins_that_are_full_or_beyond_the_longest_core_end_it(row: list[int]) -> None:
    usable = usable_counts(np.array([row]))[0]
    ends = next(
        (i for i, own in enumerate(row) if own >= FULL or sum(row[: i + 1]) > MOST_CORE),
        len(row),
    )
    assert usable.tolist() == [*row[:ends], *[0] * (len(row) - ends)]


def test_the_longest_core_is_met_and_not_exceeded() -> None:
    row = [254, 254, 254, 254, 7, 1, 0, 1]
    assert sum(row[:5]) == MOST_CORE
    found = solve(np.zeros(1), np.ones(1), np.array([row]), 10_000)
    assert (found.cut.tolist(), found.k.tolist(), found.rank) == ([5], [MOST_CORE], None)


@settings(max_examples=200)
@given(st.lists(st.integers(0, 12), min_size=1, max_size=20), st.data())
def test_with_one_fragment_a_bin_the_counts_are_those_of_lambda_but_for_near_ties(
    lists: list[int], data: st.DataObject
) -> None:
    n = np.array(lists)
    counts = (np.arange(12) < n[:, None]).astype(np.int64)
    a = np.array([data.draw(st.floats(-30.0, 10.0, width=32)) for _ in lists], dtype=np.float32)
    b = np.array([data.draw(st.floats(0.03125, 4.0, width=32)) for _ in lists], dtype=np.float32)
    budget = data.draw(st.integers(0, int(n.sum()) + 1))
    found = solve(a, b, counts, budget)
    expected, log_lambda = solve_lambda(a, b, n, budget)
    # Prices of one rank are as one; a rounding may put one into the next.
    at = rank_of(np.array([-log_lambda]))[0]
    for p in np.flatnonzero(found.k != expected):
        k = np.arange(min(found.k[p], expected[p]) + 1, max(found.k[p], expected[p]) + 1)
        assert (np.abs(rank_of((k - 1.5) * b[p].astype(np.float64) - a[p]) - at) <= 1).all()


def test_equal_curves_share_by_index_until_one_does_not_fit() -> None:
    counts = np.tile([2, 3, 0, 4], (10, 1))
    found = solve(np.full(10, -8.0), np.full(10, 0.5), counts, 20 + 3 * 4 + 2)
    assert found.cut.tolist() == [2] * 4 + [1] * 6
    assert found.k.sum() == 20 + 3 * 4


def test_one_that_does_not_fit_ends_it_for_those_behind_though_they_would_fit() -> None:
    # Equal prices: b (M + N) / 2 - b - a of a bin of 4 fragments and, with another a, of one of 1.
    counts, fall_ = np.array([[4, 0, 0, 0], [4, 0, 0, 0], [1, 0, 0, 0]]), np.ones(3)
    found = solve(np.array([0.0, 0.0, -1.5]), fall_, counts, 5)
    assert found.k.tolist() == [4, 0, 0]


def test_what_is_nan_comes_after_all_others() -> None:
    a, b = np.array([NAN, -8.0, -1e9, INF]), np.array([0.5, 0.5, NAN, 2.0])
    counts = np.tile([2, 1, 3, 3], (4, 1))
    for budget in (9, 18):
        k = solve(a, b, counts, budget).k
        assert k[0] == k[2] == 0
        assert k.sum() == budget
    assert solve(a, b, counts, 36).k.tolist() == [9, 9, 9, 9]


def test_without_importance_a_pixel_comes_last() -> None:
    w = np.array([NAN, 0.9, 1e-3, 0.0, 1e-13])  # above 65,528, prices are one rank: less than 1e-4 is none
    found = solve(*importance_curve(w), np.tile([1] * 8, (5, 1)), 16)
    assert found.k.tolist() == [0, 8, 8, 0, 0]


@given(st.floats(0.0009765625, 1.0, width=32), st.integers(1, 100))
def test_importances_ask_for_fragments_in_proportion(w: float, k: int) -> None:
    a, b = (float(each[0]) for each in importance_curve(np.array([w])))
    # Cut k - 1 becomes k at t = b (k - 1.5) - a = k / w: as Eq. 3 with a scale t does.
    assert b * (k - 1.5) - a == pytest.approx(k / w, rel=1e-6)


@given(st.floats(-(2.0**59), 2.0**59, width=32), st.floats(2.0**-12, 2.0**59, width=32))
def test_what_a_trained_network_answers_is_within_the_limits_as_it_is(a: float, b: float) -> None:
    kept = within_limits(np.array([a]), np.array([b]))
    assert (kept[0][0], kept[1][0]) == (np.float32(a), np.float32(b))


@pytest.mark.parametrize("a", [NAN, INF, -INF, 3e38])
@pytest.mark.parametrize("b", [NAN, INF, 0.0, -1.0])
def test_whatever_a_network_answers_is_within_the_limits(a: float, b: float) -> None:
    kept = within_limits(np.array([a]), np.array([b]))
    assert abs(kept[0][0]) <= MOST_GAIN
    assert LEAST_FALL <= kept[1][0] <= MOST_FALL


def test_a_frame_without_fragments_has_no_core() -> None:
    found = solve(np.zeros(3), np.ones(3), np.zeros((3, 8), np.int64), 5)
    assert (found.k.tolist(), found.cut.tolist(), found.rank) == ([0] * 3, [0] * 3, None)
