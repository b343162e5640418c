"""Both fills use a budget exactly and agree with their plain definitions, whatever the weights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.allocation.fill import budget_fill, solve_lambda

pytestmark = pytest.mark.usefixtures("single_thread")


counts = st.lists(st.one_of(st.integers(0, 6), st.sampled_from([0, 1, 4096])), min_size=1, max_size=12)
weight = st.one_of(st.sampled_from([0.0, 1.0, 1.0, 3.0]), st.floats(0.0, 2.0**127, width=32))
gain = st.one_of(st.sampled_from([0.0, -5.0]), st.floats(-200.0, 200.0, width=32))
decay = st.one_of(st.sampled_from([0.5, 1.0]), st.floats(0.03125, 300.0, width=32))


def limits_hold(k: np.ndarray, n: np.ndarray, budget: int) -> bool:
    return bool(k.sum() == min(budget, n.sum()) and (k >= 0).all() and (k <= n).all())


@settings(max_examples=300, deadline=None)
@given(counts, st.data())
def test_the_budget_fill_is_exact_and_monotone_in_the_weights(lists: list[int], data: st.DataObject) -> None:
    n = np.array(lists)
    weights = np.array([data.draw(weight) for _ in lists], dtype=np.float32)
    budget = data.draw(st.integers(0, int(1.2 * n.sum()) + 1))
    k = budget_fill(weights, n, budget)
    assert limits_hold(k, n, budget)
    for p in range(len(n)):
        for q in range(len(n)):
            if weights[p] > weights[q]:  # a heavier pixel has at least as much, if it has as many fragments
                assert k[p] >= min(k[q], n[p])


@settings(max_examples=300, deadline=None)
@given(counts, st.data())
def test_the_price_is_exact_and_its_counts_are_those_of_the_formula(lists: list[int], data: st.DataObject) -> None:
    n = np.array(lists)
    a = np.array([data.draw(gain) for _ in lists], dtype=np.float32)
    b = np.array([data.draw(decay) for _ in lists], dtype=np.float32)
    budget = data.draw(st.integers(0, int(1.2 * n.sum()) + 1))
    k, log_lambda = solve_lambda(a, b, n, budget)
    assert limits_hold(k, n, budget)

    a, b = a.astype(np.float64), b.astype(np.float64)
    at_price = np.clip(np.floor(1.5 + (a - log_lambda) / b), 0, n)
    assert (at_price <= k).all()
    # The remainder went, one each, to pixels that grow at the next price: to no others, and to the first of them.
    grew, could = k > at_price, at_price < n
    next_price = a - (at_price - 0.5) * b
    if grew.any():
        assert (k - at_price).max() == 1
        others = np.flatnonzero(could & ~grew)
        assert (next_price[grew].min() >= next_price[others] - 1e-9 * (np.abs(a) + n * b)[others]).all()
        tied = others[next_price[others] == next_price[grew].max()]
        assert (tied > np.flatnonzero(grew).max()).all()


def test_a_million_equal_pixels_share_by_index() -> None:
    n = np.full(1_000_000, 3)
    k = budget_fill(np.ones(len(n), np.float32), n, 1_234_567)
    assert k.sum() == 1_234_567
    assert (np.diff(k) <= 0).all()


def test_ten_million_small_weights_lose_nothing() -> None:
    rng = np.random.default_rng(0)
    n = rng.integers(0, 4, 10_000_000).astype(np.int32)
    k = budget_fill(rng.random(len(n), dtype=np.float32) * np.float32(1e-7), n, 12_345_678)
    assert limits_hold(k, n, 12_345_678)
