"""Default budgets lie where something has to be decided, whatever was captured."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from labeller.budgets import MOST_HELD, RUNGS, RUNGS_OF_A_VIEW, default_budgets

loads = st.lists(st.floats(0.0, 1e6), max_size=12)


@given(loads, st.randoms())
def test_they_are_rungs_ascending_once_each_in_any_order_of_views(views: list[float], random: object) -> None:
    found = default_budgets(views)
    assert set(found) <= set(RUNGS)
    assert 0.05 <= min(found) <= max(found) <= 4.0
    assert all(low < high for low, high in pairwise(found))
    shuffled = list(views)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    assert default_budgets(shuffled) == default_budgets(iter(views)) == found


@given(loads)
def test_each_view_has_a_budget_below_its_fragments_unless_it_has_next_to_none(views: list[float]) -> None:
    found = default_budgets(views)
    for load in views:
        assert min(found) < load or load <= RUNGS[0]


@given(st.floats(0.0, 1e6))
def test_the_budgets_of_one_view_are_the_largest_that_decide_something(load: float) -> None:
    found = default_budgets([load])
    held = [rung for rung in RUNGS if rung <= MOST_HELD * load]
    assert found == (tuple(held[-RUNGS_OF_A_VIEW:]) if held else RUNGS[:1])


@given(loads, st.floats(0.0, 1e6))
def test_one_more_view_only_adds_budgets(views: list[float], load: float) -> None:
    assert set(default_budgets([*views, load])) == set(default_budgets([load])) | (
        set(default_budgets(views)) if views else set()
    )


@pytest.mark.parametrize(
    ("views", "expected"),
    [
        ([], (0.05,)),
        ([0.01], (0.05,)),
        ([0.06], (0.05,)),
        ([0.3], (0.05, 0.125)),
        ([2.4], (0.25, 0.5, 1.0)),
        ([8.0], (1.0, 2.0, 4.0)),
        ([92.0], (1.0, 2.0, 4.0)),
        ([0.9, 2.4], (0.125, 0.25, 0.5, 1.0)),
    ],
)
def test_known_depths(views: list[float], expected: tuple[float, ...]) -> None:
    assert default_budgets(views) == expected
