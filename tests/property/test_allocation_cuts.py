"""Whole bins within a budget: against a plain loop over events, and what must hold whatever a network answers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from renderer.allocation.cuts import FULL, MOST_CORE, Cuts, events_of, solve_cuts, usable_counts
from renderer.allocation.prices import (
    LEAST_PRICE,
    LEAST_PRIOR,
    PRICE_STEPS,
    RANKS,
    gain_prices,
    importance_prices,
    prior_gains,
    ranks_of,
)
from schemas.tail import DEFAULT_TAIL, TAILS

pytestmark = pytest.mark.usefixtures("single_thread")

NAN, INF = float("nan"), float("inf")
price = st.one_of(st.sampled_from([0.0, 8.0, -1e30, 1e30, NAN, INF, -INF]), st.floats(-20.0, 60.0, width=32))
count = st.one_of(st.integers(0, 4), st.sampled_from([0, 1, 40, FULL - 1, FULL]))


Frame = tuple[NDArray[np.float32], NDArray[np.int64], int]


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Prices and counts by bin, and a budget, often one on an edge; all pixels are alike at times."""
    pixels, bins = draw(st.integers(1, 8)), draw(st.sampled_from([4, 8, 12]))

    def rows(each: st.SearchStrategy[float] | st.SearchStrategy[int]) -> st.SearchStrategy[list[list[float]]]:
        return st.lists(st.lists(each, min_size=bins, max_size=bins), min_size=pixels, max_size=pixels)

    counts, prices = np.array(draw(rows(count))), np.array(draw(rows(price)), dtype=np.float32)
    if draw(st.booleans()):
        prices[:] = prices[0]
    total = int(usable_counts(counts).sum())
    edges = {0, 1, max(total - 1, 0), total, 2 * total}
    return prices, counts, draw(st.one_of(st.sampled_from(sorted(edges)), st.integers(0, total + 1)))


def plain_rank(price: float) -> int:
    """Rank of one price, spelled out."""
    if math.isnan(price):
        return RANKS - 1
    return math.floor(min(max((price - LEAST_PRICE) * PRICE_STEPS + 0.5, 0), RANKS - 1))


def plain_cuts(prices: NDArray[np.float32], counts: NDArray[np.integer], budget: int) -> tuple[list[int], list[int]]:
    """Cuts and k of all pixels: events one by one, by rising rank, then pixel and bin, until one no longer fits."""
    events: dict[int, list[tuple[int, int, int]]] = {}
    for p, row in enumerate(counts.tolist()):
        before, rank = 0, 0
        for bin_, own in enumerate(row):
            if own >= FULL or before + own > MOST_CORE:
                break
            if own:
                rank = max(rank, plain_rank(float(prices[p, bin_])))
                events.setdefault(rank, []).append((p, bin_, own))
            before += own
    cut, k, spent = [0] * len(counts), [0] * len(counts), 0
    for rank in sorted(events):
        for p, bin_, own in sorted(events[rank]):
            if spent + own > budget:
                return cut, k
            cut[p], k[p], spent = bin_ + 1, k[p] + own, spent + own
    return cut, k


def solve(prices: NDArray[np.floating], counts: NDArray[np.integer], budget: int) -> Cuts:
    return solve_cuts(events_of(ranks_of(prices.astype(np.float32), counts), counts), budget)


@settings(max_examples=400)
@given(frames())
def test_cuts_are_those_of_the_plain_loop(frame: Frame) -> None:
    prices, counts, budget = frame
    found = solve(prices, counts, budget)
    cut, k = plain_cuts(prices, counts, budget)
    assert found.cut.tolist() == cut
    assert found.k.tolist() == k


@settings(max_examples=300)
@given(frames())
def test_a_budget_is_met_up_to_one_bin_of_one_pixel(frame: Frame) -> None:
    prices, counts, budget = frame
    usable, found = usable_counts(counts), solve(prices, counts, budget)
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
def test_what_a_price_grants_is_granted_at_any_greater_budget(frame: Frame) -> None:
    prices, counts, budget = frame
    less, more = (solve(prices, counts, each) for each in (budget, budget + 7))
    assert more.rank is None or (less.rank is not None and less.rank <= more.rank)
    # Of the pixels that grow at one price the first ones by index do: more of them for a greater budget.
    assert (more.cut >= less.cut).all()


@given(st.lists(price, min_size=8, max_size=8), st.lists(st.integers(0, 60), min_size=8, max_size=8))
def test_ranks_rise_from_bin_to_bin(prices: list[float], row: list[int]) -> None:
    ranks = ranks_of(np.array([prices], dtype=np.float32), np.array([row]))[0].astype(int)
    assert (np.diff(ranks) >= 0).all()
    assert ((ranks >= 0) & (ranks <= RANKS - 1)).all()


@given(st.floats(width=32, allow_nan=False), st.floats(width=32, allow_nan=False))
def test_ranks_do_not_fall_as_prices_rise(one: float, other: float) -> None:
    low, high = sorted((one, other))
    ranks = [int(ranks_of(np.array([[each]], dtype=np.float32), np.ones((1, 1)))[0, 0]) for each in (low, high)]
    assert ranks[0] <= ranks[1]
    if low > LEAST_PRICE and high < LEAST_PRICE + (RANKS - 2) / PRICE_STEPS and high - low > 1.01 / PRICE_STEPS:
        assert ranks[0] < ranks[1]


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
    found = solve(np.arange(8.0)[None], np.array([row]), 10_000)
    assert (found.cut.tolist(), found.k.tolist(), found.rank) == ([5], [MOST_CORE], None)


def test_equal_prices_share_by_index_until_one_does_not_fit() -> None:
    counts = np.tile([2, 3, 0, 4], (10, 1))
    found = solve(np.tile([1.0, 2.0, 3.0, 4.0], (10, 1)), counts, 20 + 3 * 4 + 2)
    assert found.cut.tolist() == [2] * 4 + [1] * 6
    assert found.k.sum() == 20 + 3 * 4


def test_one_that_does_not_fit_ends_it_for_those_behind_though_they_would_fit() -> None:
    counts = np.array([[4, 0, 0, 0], [4, 0, 0, 0], [1, 0, 0, 0]])
    assert solve(np.full((3, 4), 2.0), counts, 5).k.tolist() == [4, 0, 0]


def test_a_bin_is_not_worth_less_than_those_in_front_of_it_and_an_empty_one_does_not_count() -> None:
    prices = np.array([[5.0, 1.0, 9.0, 6.0]], dtype=np.float32)
    assert ranks_of(prices, np.array([[1, 1, 0, 1]])).tolist() == [[72, 72, 72, 80]]
    assert ranks_of(prices, np.array([[0, 1, 1, 0]])).tolist() == [[0, 40, 104, 104]]


def test_what_is_nan_comes_after_all_others() -> None:
    prices = np.repeat(np.array([NAN, 8.0, NAN, -INF])[:, None], 4, axis=1)
    counts = np.tile([2, 1, 3, 3], (4, 1))
    for budget in (9, 18):
        k = solve(prices, counts, budget).k
        assert k[0] == k[2] == 0
        assert k.sum() == budget
    assert solve(prices, counts, 36).k.tolist() == [9, 9, 9, 9]


def test_without_importance_a_pixel_comes_last() -> None:
    w, counts = np.array([NAN, 0.9, 1e-13, 0.0, 0.8], dtype=np.float32), np.tile([1] * 8, (5, 1))
    found = solve(importance_prices(w, counts), counts, 16)
    assert found.k.tolist() == [0, 8, 0, 0, 8]


@given(st.floats(0.0009765625, 1.0, width=32), st.lists(st.integers(1, 9), min_size=4, max_size=8))
def test_importances_ask_for_fragments_in_proportion(w: float, row: list[int]) -> None:
    prices = importance_prices(np.array([w], dtype=np.float32), np.array([row]))[0]
    # Eq. 3 with a scale t asks for floor(t w): the middle of a bin is the nearest whole number to t w - 1/2.
    middle = np.cumsum(row) - np.array(row) / 2.0
    np.testing.assert_allclose(np.exp(prices / 2.0) * w - 0.5, middle, rtol=1e-4)


@given(st.lists(st.integers(0, 255), min_size=11, max_size=11), st.floats(0.0, 200.0, width=32))
def test_what_the_tail_tells_is_finite_and_falls_behind_what_covers(steps: list[int], optical_depth: float) -> None:
    front = np.concatenate([[0.0], np.sort(steps) / 255.0, [1.0]]).astype(np.float32)[None]
    ones = np.ones((1, 12), np.int64)
    prior = prior_gains(front, np.array([optical_depth], np.float32), ones, TAILS[DEFAULT_TAIL])
    assert np.isfinite(prior).all()
    assert (prior >= LEAST_PRIOR).all()
    # More fragments that cover as much are worth less each, but that one alone is in its place.
    few, many = (
        prior_gains(front, np.array([optical_depth], np.float32), n * ones, TAILS[DEFAULT_TAIL]) for n in (2, 7)
    )
    assert (many <= few).all()


def test_the_prior_is_what_its_formula_says() -> None:
    front, counts = np.array([[0.0, 0.25, 0.25, 1.0]], np.float32), np.array([[1, 0, 3]])
    tail = replace(TAILS[DEFAULT_TAIL], bins=3)
    found = prior_gains(front, np.array([2.0], np.float32), counts, tail)[0]
    alone = math.log(1.0 - math.exp(-0.5)) + math.log(2.0 * 0.5 / 255.0)
    assert found[0] == pytest.approx(2.0 * alone, rel=1e-6)
    assert found[2] == pytest.approx(2.0 * math.log(1.0 - math.exp(-1.5)) - 1.0 - math.log(3.0), rel=1e-6)


@pytest.mark.parametrize("bad", [NAN, INF, -INF, 3e38])
def test_whatever_a_network_answers_has_a_rank(bad: float) -> None:
    answers = np.full((1, 13), bad, dtype=np.float32)
    prices = gain_prices(answers, np.full((1, 12), -3.0, dtype=np.float32))
    ranks = ranks_of(prices, np.ones((1, 12), np.int64))
    assert ((ranks == 0) | (ranks == RANKS - 1)).all()


def test_a_frame_without_fragments_has_no_core() -> None:
    found = solve(np.zeros((3, 8)), np.zeros((3, 8), np.int64), 5)
    assert (found.k.tolist(), found.cut.tolist(), found.rank) == ([0] * 3, [0] * 3, None)
