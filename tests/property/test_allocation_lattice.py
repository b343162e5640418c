"""The lattice form of lambda uses a budget exactly, whatever the curves, and is the float64 form but for ties."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from renderer.allocation.fill import budget_fill, solve_lambda
from renderer.allocation.lattice import (
    EDGES,
    LAST,
    MOST_FRAGMENTS,
    MOST_GAIN,
    ROUNDS,
    Curves,
    curves_of,
    fragments_at,
    importance_curves,
    price,
    solve_on_lattice,
    within_limits,
)
from renderer.screen import TURNS
from schemas.bundle import GAIN_FLOOR

pytestmark = pytest.mark.usefixtures("single_thread")

counts = st.lists(st.one_of(st.integers(0, 6), st.sampled_from([0, 1, 4096])), min_size=1, max_size=12)
NAN, INF = float("nan"), float("inf")
gain = st.one_of(st.sampled_from([0.0, -5.0, -1e30, 1e30, NAN, INF, -INF]), st.floats(-200.0, 200.0, width=32))
decay = st.one_of(st.sampled_from([0.5, GAIN_FLOOR, 1e30, NAN, INF]), st.floats(0.03125, 300.0, width=32))


def drawn(data: st.DataObject, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    a, b = (np.array([data.draw(each) for _ in n], dtype=np.float32) for each in (gain, decay))
    return a, b


def drawn_budget(data: st.DataObject, n: np.ndarray) -> int:
    occupied, total = int(np.count_nonzero(n)), int(n.sum())
    edges = {0, 1, max(occupied - 1, 0), occupied, max(total - 1, 0), total, 2 * total}
    return data.draw(st.one_of(st.sampled_from(sorted(edges)), st.integers(0, total + 1)))


@settings(max_examples=300)
@given(counts, st.data())
def test_a_budget_is_met_to_the_fragment(lists: list[int], data: st.DataObject) -> None:
    n = np.array(lists)
    curves, budget = curves_of(*drawn(data, n)), drawn_budget(data, n)
    found = solve_on_lattice(curves, n, budget)
    k = found.k
    assert k.sum() == min(budget, n.sum())
    assert (k >= 0).all()
    if found.index is None:
        assert np.array_equal(k, n)
        return
    # At its price it is within the budget, at the next one beyond it; what is left went there, by pixel index.
    below, above = (fragments_at(price(found.index + step), curves, n) for step in (0, 1))
    assert below.sum() <= budget < above.sum()
    assert ((below <= k) & (k <= above)).all()
    partly = np.flatnonzero(k < above)
    grew = np.flatnonzero(k > below)
    assert len(grew) == 0 or len(partly) == 0 or (grew <= partly.min()).all()


@settings(max_examples=200)
@given(counts, st.data(), st.integers(-LAST, LAST))
def test_what_is_found_does_not_depend_on_the_start(lists: list[int], data: st.DataObject, start: int) -> None:
    n = np.array(lists)
    curves, budget = curves_of(*drawn(data, n)), drawn_budget(data, n)
    cold = solve_on_lattice(curves, n, budget)
    assert cold.rounds <= 4
    starts = [start] if cold.index is None else [start, cold.index - 1000, cold.index + 1000, cold.index]
    for each in starts:
        warm = solve_on_lattice(curves, n, budget, max(min(each, LAST), -LAST))
        assert np.array_equal(warm.k, cold.k)
        assert warm.index == cold.index
        assert warm.rounds <= ROUNDS
        if cold.index is not None and abs(each - cold.index) <= 1000:
            assert warm.rounds <= 2


@settings(max_examples=200)
@given(counts, st.data())
def test_counts_are_those_of_float64_but_for_what_grows_between_two_prices(
    lists: list[int], data: st.DataObject
) -> None:
    n = np.array(lists)
    a = np.array([data.draw(st.floats(-30.0, 10.0, width=32)) for _ in lists], dtype=np.float32)
    b = np.array([data.draw(st.floats(0.03125, 4.0, width=32)) for _ in lists], dtype=np.float32)
    budget = drawn_budget(data, n)
    found = solve_on_lattice(curves_of(a, b), n, budget)
    expected, log_lambda = solve_lambda(a, b, n, budget)
    if found.index is None:
        return
    # A fragment that only one of the two gives comes at a price as close as rounding and the lattice are.
    t = float(price(found.index))
    near = 2.0 * (float(price(found.index + 1)) - t) + 4e-7 * (float(np.abs(a).max()) + abs(t) + float((n * b).max()))
    for p in np.flatnonzero(found.k != expected):
        k = np.arange(min(found.k[p], expected[p]) + 1, max(found.k[p], expected[p]) + 1)
        assert (np.abs((k - 1.5) * b[p].astype(np.float64) - a[p] + log_lambda) <= near).all()


weight = st.one_of(
    st.sampled_from([0.0, NAN, 1e-13, 0.25, 0.5, 1.0]),
    st.floats(0.0, 1.0, width=32),
    st.floats(-30.0, 0.0).map(lambda exponent: 10.0**exponent),
)


@settings(max_examples=300)
@given(counts, st.data())
def test_counts_of_importances_are_those_of_the_fill_but_for_what_grows_between_two_prices(
    lists: list[int], data: st.DataObject
) -> None:
    n = np.array(lists)
    w = np.array([data.draw(weight) for _ in lists], dtype=np.float32)
    curves, budget = importance_curves(w), drawn_budget(data, n)
    found = solve_on_lattice(curves, n, budget)
    # What is none has the least importance, so that it has a scale, too.
    expected = budget_fill(curves.rate, n, budget)
    assert found.k.sum() == expected.sum() == min(budget, n.sum())
    assert (found.k >= 0).all()
    if found.index is None:
        return
    t, following = float(price(found.index)), float(price(found.index + 1))
    near = 2.0 * (following - t) + 1e-6 * t
    for p in np.flatnonzero(found.k != expected):
        k = np.arange(min(found.k[p], expected[p]) + 1, max(found.k[p], expected[p]) + 1)
        assert (np.abs(k / curves.rate[p].astype(np.float64) - t) <= near).all()


def test_without_importance_a_pixel_comes_last_and_is_like_its_kind() -> None:
    w, n = np.array([NAN, 0.9, 1e-13, 0.0, 1e-35]), np.full(5, 9)
    found = [solve_on_lattice(importance_curves(w), n, budget).k.tolist() for budget in (2, 5, 21, 27)]
    assert found == [[0, 2, 0, 0, 0], [0, 5, 0, 0, 0], [1, 9, 9, 1, 1], [3, 9, 9, 3, 3]]


@given(st.integers(-LAST, LAST - 1), gain, decay, st.integers(0, MOST_FRAGMENTS))
def test_counts_do_not_fall_with_the_price(index: int, a: float, b: float, n: int) -> None:
    curves, most = curves_of(np.array([a]), np.array([b])), np.array([n])
    assert price(index) < price(index + 1)
    assert fragments_at(price(index), curves, most) <= fragments_at(price(index + 1), curves, most)


@given(st.floats(-(2.0**100), 2.0**100, width=32), st.floats(2.0**-12, 2.0**98, width=32))
def test_what_a_trained_network_answers_is_within_the_limits_as_it_is(a: float, b: float) -> None:
    gain, decay = within_limits(np.array([a]), np.array([b]))
    assert (gain[0], decay[0]) == (np.float32(a), np.float32(b))


def test_what_is_nan_comes_after_all_others() -> None:
    a, b = np.array([NAN, -8.0, -1e9, INF]), np.array([0.5, 0.5, NAN, 2.0])
    found = [solve_on_lattice(curves_of(a, b), np.full(4, 9), budget).k.tolist() for budget in (4, 20, 22, 30)]
    assert found[0] == [0, 0, 0, 4]
    assert found[1][1::2] == [9, 9]
    assert [k[1::2] for k in found[1:]] == [[9, 9]] * 3
    assert [sum(k) for k in found] == [4, 20, 22, 30]


@pytest.mark.parametrize("a", [-MOST_GAIN, 0.0, MOST_GAIN])
@pytest.mark.parametrize("b", [1e-30, GAIN_FLOOR, 1.0, 3e38])
def test_the_ends_of_the_lattice_give_all_and_none(a: float, b: float) -> None:
    curves, n = curves_of(np.array([a]), np.array([b])), np.array([MOST_FRAGMENTS])
    assert np.isfinite(curves.rate).all()
    assert fragments_at(price(LAST), curves, n) == MOST_FRAGMENTS
    assert fragments_at(price(-LAST), curves, n) == 0


def test_equal_curves_share_by_index() -> None:
    n = np.full(10_000, 9)
    curves = curves_of(np.full(len(n), -8.0), np.full(len(n), 0.5))
    found = solve_on_lattice(curves, n, 34_567)
    assert found.k.sum() == 34_567
    assert set(np.unique(found.k)) == {3, 4}
    assert (np.diff(found.k) <= 0).all()


def test_the_error_of_the_prices_is_small_against_any_curve_that_matters() -> None:
    steps = [float(price(i + 1)) - float(price(i)) for i in range(-200_000, 200_000, 37)]
    values = [abs(float(price(i))) for i in range(-200_000, 200_000, 37)]
    assert (np.array(steps) <= 2.0**-13 * (1.0 + np.array(values))).all()
    assert max(values) > 4000.0
    assert EDGES * EDGES / 2 * 2.0**-14 >= 0.1, "a warm start reaches a tenth of a log unit around any price"


def test_fragments_beyond_those_a_shader_can_visit_get_no_slots() -> None:
    assert MOST_FRAGMENTS == TURNS
    n = np.array([MOST_FRAGMENTS + 5, 3])
    found = solve_on_lattice(Curves(np.zeros(2, np.float32), np.ones(2, np.float32)), n, 10**9)
    assert found.k.tolist() == [MOST_FRAGMENTS, 3]
