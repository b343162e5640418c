"""Fast allocations against the literal heap and against exhaustive dynamic programming."""

from __future__ import annotations

from collections.abc import Iterator

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.curves import curves_of, dump_for, split
from support.dumps import random_dump

from labeller import reference
from labeller.curves import error_curves
from labeller.rules import allocate_curves
from schemas.tail import TailName


@pytest.fixture(autouse=True, scope="module")
def _one_thread() -> Iterator[None]:
    """Thousands of tiny calls: threads would only wait for each other."""
    threads = numba.get_num_threads()
    numba.set_num_threads(1)
    yield
    numba.set_num_threads(threads)


# Few distinct values, so that ties within and between pixels are common, next to arbitrary ones.
errors = st.one_of(st.sampled_from([0.0, 0.25, 0.5, 1.0, 2.0]), st.floats(0.0, 4.0, width=32))
curve_lists = st.lists(st.lists(errors, max_size=7).map(lambda e: [*e, 0.0]), min_size=1, max_size=7)


@settings(max_examples=300, deadline=None)
@given(curve_lists, st.data())
def test_selection_removes_what_the_heap_removes_ties_included(lists: list[list[float]], data: st.DataObject) -> None:
    curves = curves_of(lists)
    total = int(curves.counts.sum())
    budget = data.draw(st.integers(0, total))
    for rule, key in (("greedy", "absolute"), ("increment", "increment")):
        (found,) = allocate_curves(dump_for(curves), curves, [budget], rule)
        assert found.k.tolist() == reference.heap_removal(split(curves), budget, found.k_min, key)


@pytest.mark.parametrize("tail", ["density", "paper"])
def test_selection_removes_what_the_heap_removes_on_a_view(tail: TailName) -> None:
    dump = random_dump(60, 40, 9, seed=1)
    curves = error_curves(dump, tail)
    occupied = int(np.count_nonzero(dump.counts))
    budgets = [0, 100, occupied - 1, occupied, dump.total // 2, dump.total - 1]
    for rule, key in (("greedy", "absolute"), ("increment", "increment")):
        for found in allocate_curves(dump, curves, budgets, rule):
            heap = reference.heap_removal(split(curves), found.budget, found.k_min, key)
            assert np.array_equal(found.k, heap), (rule, found.budget)


def check_certificate(lists: list[list[float]], budget: int) -> None:
    curves = curves_of(lists)
    (found,) = allocate_curves(dump_for(curves), curves, [budget], "optimal")
    best = reference.optimum(split(curves), budget, found.k_min)
    assert found.bound is not None
    assert found.gap is not None
    assert found.bound <= best * (1 + 1e-12)
    assert best <= found.error * (1 + 1e-12)
    assert found.error * (1 - found.gap) == pytest.approx(found.bound, rel=1e-12, abs=1e-300)


@settings(max_examples=300, deadline=None)
@given(curve_lists, st.data())
def test_the_true_optimum_lies_between_bound_and_result(lists: list[list[float]], data: st.DataObject) -> None:
    budget = data.draw(st.integers(0, sum(len(e) - 1 for e in lists)))
    check_certificate(lists, budget)


def test_the_true_optimum_lies_between_bound_and_result_on_a_thousand_random_cases() -> None:
    rng = np.random.default_rng(0)
    for case in range(1000):
        lists = [[*rng.random(rng.integers(0, 9)), 0.0] for _ in range(rng.integers(1, 9))]
        if case % 2:  # mostly falling, as real curves are
            lists = [sorted(e, reverse=True) for e in lists]
        check_certificate(lists, budget=int(rng.integers(0, sum(len(e) - 1 for e in lists) + 1)))


def test_views_of_some_hundred_pixels_are_optimal_to_a_thousandth() -> None:
    dump = random_dump(20, 15, 8, seed=2)
    curves = error_curves(dump)
    for share in (0.25, 0.4, 0.6):
        (found,) = allocate_curves(dump, curves, [int(share * dump.total)], "optimal")
        best = reference.optimum(split(curves), found.budget, found.k_min)
        assert best * (1 - 1e-12) <= found.error <= best * 1.001
