"""The fill uses a budget exactly, whatever the weights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.allocation.fill import budget_fill

pytestmark = pytest.mark.usefixtures("single_thread")


counts = st.lists(st.one_of(st.integers(0, 6), st.sampled_from([0, 1, 4096])), min_size=1, max_size=12)
weight = st.one_of(st.sampled_from([0.0, 1.0, 1.0, 3.0]), st.floats(0.0, 2.0**127, width=32))


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
