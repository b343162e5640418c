"""The fills on cases that can be counted by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from renderer.allocation.fill import budget_fill, paper_fill


def test_weights_share_a_budget_in_proportion() -> None:
    k = budget_fill(np.array([1.0, 2.0, 5.0]), np.array([50, 50, 50]), budget=80)
    assert k.tolist() == [10, 20, 50]


def test_what_full_pixels_cannot_take_goes_to_the_others() -> None:
    assert budget_fill(np.array([1.0, 1.0, 100.0]), np.array([9, 9, 2]), budget=12).tolist() == [5, 5, 2]


def test_the_remainder_goes_by_pixel_index_where_fractions_are_equal() -> None:
    assert budget_fill(np.ones(4), np.full(4, 9), budget=10).tolist() == [3, 3, 2, 2]


def test_the_remainder_goes_to_the_largest_fraction() -> None:
    assert budget_fill(np.array([1.0, 1.9]), np.array([9, 9]), budget=2).tolist() == [1, 1]
    assert budget_fill(np.array([1.0, 2.1]), np.array([9, 9]), budget=2).tolist() == [0, 2]


def test_pixels_without_weight_come_last() -> None:
    n = np.array([3, 3, 3])
    assert budget_fill(np.array([0.0, 1.0, 0.0]), n, budget=3).tolist() == [0, 3, 0]
    assert budget_fill(np.array([0.0, 1.0, 0.0]), n, budget=6).tolist() == [2, 3, 1]
    assert budget_fill(np.zeros(3), n, budget=4).tolist() == [2, 1, 1]


def test_weights_of_all_magnitudes_are_used() -> None:
    weights = np.array([1e-45, 1e-30, 1.0, 3e38], dtype=np.float32)
    for budget in range(33):
        assert budget_fill(weights, np.full(4, 8), budget).sum() == budget


@pytest.mark.parametrize("weights", [[1.0, -1.0], [1.0, math.nan], [math.inf, 1.0]])
def test_weights_that_are_no_weights_are_refused(weights: list[float]) -> None:
    with pytest.raises(ValueError, match="finite and not negative"):
        budget_fill(np.array(weights), np.array([2, 2]), 2)


def test_no_budget_leaves_every_pixel_empty() -> None:
    n = np.array([2, 0, 1])
    assert budget_fill(np.ones(3), n, 0).tolist() == [0, 0, 0]


def test_a_negative_budget_is_refused() -> None:
    with pytest.raises(ValueError, match="cannot be negative"):
        budget_fill(np.ones(3), np.array([2, 0, 1]), -1)


def test_pixels_that_grow_together_get_the_remainder_by_index() -> None:
    assert budget_fill(np.ones(5), np.full(5, 4), budget=12).tolist() == [3, 3, 2, 2, 2]


def test_no_pixels_need_nothing() -> None:
    none = np.zeros(0)
    assert budget_fill(none, none.astype(int), 5).tolist() == []
    assert paper_fill(none, 5).tolist() == []


def test_the_papers_fill_loses_the_remainder_and_does_not_clamp() -> None:
    assert paper_fill(np.array([1.0, 1.0, 4.0]), 10).tolist() == [1, 1, 6]
    assert paper_fill(np.zeros(2), 10).tolist() == [0, 0]
