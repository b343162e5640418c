"""Fast allocations against the literal heap and against exhaustive dynamic programming."""

from __future__ import annotations

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

pytestmark = pytest.mark.usefixtures("single_thread")


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
        assert found.k.tolist() == reference.heap_removal(split(curves), budget, key)


@pytest.mark.parametrize("tail", ["density", "paper"])
def test_selection_removes_what_the_heap_removes_on_a_view(tail: TailName) -> None:
    dump = random_dump(60, 40, 9, seed=1)
    curves = error_curves(dump, tail)
    occupied = int(np.count_nonzero(dump.counts))
    budgets = [0, 100, occupied - 1, occupied, dump.total // 2, dump.total - 1]
    for rule, key in (("greedy", "absolute"), ("increment", "increment")):
        for found in allocate_curves(dump, curves, budgets, rule):
            heap = reference.heap_removal(split(curves), found.budget, key)
            assert np.array_equal(found.k, heap), (rule, found.budget)
