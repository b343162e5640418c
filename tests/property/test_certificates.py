"""What a certificate says, against exhaustive dynamic programming and against the whole view."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.curves import curves_of, dump_for, split
from support.dumps import dump_of, random_dump

from labeller import reference
from labeller.allocation import Allocation
from labeller.curves import Curves, error_curves, error_curves_by_g
from labeller.error_rules import ErrorRule
from labeller.rules import allocate_curves
from labeller.streaming import allocate_bands
from renderer.tile_range import tile_grid, tile_ranges
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.tail import METRICS, RANGE_TILE, MetricName

pytestmark = pytest.mark.usefixtures("single_thread")


def dual_bound(curves: Curves, lam: float, budget: int) -> float:
    """The dual function at a price, from the whole curves, in plain float64."""
    least = [min(float(e[k]) + lam * k for k in range(len(e))) for e in split(curves)]
    return sum(least) - lam * budget


def check(curves: Curves, budgets: list[int]) -> list[Allocation]:
    found = allocate_curves(dump_for(curves), curves, budgets, "optimal")
    rules = [allocate_curves(dump_for(curves), curves, budgets, rule) for rule in ("greedy", "increment")]
    for x, *others in zip(found, *rules, strict=True):
        best = reference.optimum(split(curves), x.budget)
        assert x.bound is not None
        assert x.lam is not None
        assert x.bound <= best * (1 + 1e-12)
        assert best <= x.error * (1 + 1e-12) + 1e-300
        assert x.error == pytest.approx(curves.total(x.k), rel=1e-14)
        assert x.used == x.k.sum() <= x.budget
        # The price alone certifies nearly as much, and anybody can check it without trusting the search.
        assert dual_bound(curves, x.lam, x.budget) <= best * (1 + 1e-9) + 1e-12
        if x.proven:
            assert x.error <= best * (1 + 1e-12) + 1e-300
        for other in others:
            assert x.error <= other.error * (1 + 1e-12)
    return found


def random_curves(rng: np.random.Generator, kind: int) -> Curves:
    lists = [[*rng.random(rng.integers(0, 10)), 0.0] for _ in range(rng.integers(1, 9))]
    if kind == 1:  # falling, as most real curves are
        lists = [sorted(e, reverse=True) for e in lists]
    elif kind == 2:  # over many magnitudes
        lists = [[x * 10.0 ** rng.integers(-20, 1) for x in e] for e in lists]
    elif kind == 3:  # ties everywhere
        lists = [[round(3 * x) / 3 for x in e] for e in lists]
    elif kind == 4:  # nothing helps until nearly everything is there
        lists = [[0.5 + x / 100 for x in e[:-1]] + [0.0] for e in lists]
    elif kind == 5:  # many pixels of few kinds: only some of each are looked at
        lists = [lists[i][-6:] for i in rng.integers(0, min(len(lists), 3), 60)]
    return curves_of(lists)


def test_the_bound_never_exceeds_the_optimum_in_three_thousand_random_cases() -> None:
    rng = np.random.default_rng(0)
    proven = []
    for case in range(1500):
        curves = random_curves(rng, case % 6)
        budgets = rng.integers(0, int(curves.counts.sum()) + 1, 2).tolist()
        proven += [x.proven for x in check(curves, budgets)]
    assert len(proven) == 3000
    assert all(proven)


@pytest.mark.parametrize(
    ("name", "value"),
    [("core_problem._STATES", 40), ("core_problem._WORK", 200), ("optimal._PIXELS", 3), ("optimal._AROUND", (1, 5))],
)
def test_a_search_that_may_not_look_at_everything_claims_no_more_than_it_saw(
    name: str, value: int | tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"labeller.{name}", value)
    rng = np.random.default_rng(1)
    proven = []
    for case in range(300):
        curves = random_curves(rng, case % 6)
        proven += [x.proven for x in check(curves, [int(rng.integers(0, int(curves.counts.sum()) + 1))])]
    assert 0 < sum(proven) < len(proven)


def test_the_one_pixel_that_gains_is_found_among_many_that_could_change_alike() -> None:
    # All steps tie in float32, but the last pixel's saves a little more than those that were taken before it.
    curves = curves_of([*[[1.0, 0.0]] * 30, [1 + 2**-23, 2**-23 - 2e-8, 0.0]])
    (found,) = check(curves, [10])
    assert found.k[-1] == 1


errors = st.one_of(st.sampled_from([0.0, 0.25, 0.5, 1.0, 2.0]), st.floats(0.0, 4.0, width=32))
curve_lists = st.lists(st.lists(errors, max_size=9).map(lambda e: [*e, 0.0]), min_size=1, max_size=8)


@settings(max_examples=300, deadline=None)
@given(curve_lists, st.data())
def test_the_bound_never_exceeds_the_optimum(lists: list[list[float]], data: st.DataObject) -> None:
    budget = data.draw(st.integers(0, sum(len(e) - 1 for e in lists)))
    check(curves_of(lists), [budget])


@settings(max_examples=200, deadline=None)
@given(curve_lists)
def test_the_error_of_the_optimum_never_rises_with_the_budget_and_is_never_above_a_greedy_rules(
    lists: list[list[float]],
) -> None:
    curves = curves_of(lists)
    budgets = list(range(int(curves.counts.sum()) + 2))
    found = check(curves, budgets)
    for values in ([x.error for x in found], [x.bound or 0.0 for x in found]):
        assert all(after <= before * (1 + 1e-12) for before, after in pairwise(values))


@pytest.mark.parametrize("seed", range(6))
def test_views_of_hundreds_of_pixels_reach_the_optimum_exactly(seed: int) -> None:
    curves = error_curves(random_dump(20, 15, 9, seed=seed))
    total = int(curves.counts.sum())
    found = check(curves, [int(share * total) for share in (0.25, 0.4, 0.6, 0.8)])
    assert all(x.proven and x.gap == 0.0 for x in found)


@pytest.mark.parametrize("n", [1, 10_000, 300_000])
def test_a_small_loss_next_to_the_cost_of_a_long_list_still_counts(n: int) -> None:
    # Both steps cost the same as far as float32 knows; only the second pixel's leaves nothing behind.
    curves = curves_of([[*[9.0 * n] * n, 1.0, 1e-9, 0.0], [*[9.0 * n] * n, 1.0, 0.0]])
    (found,) = allocate_curves(dump_for(curves), curves, [2 * n + 1], "optimal")
    assert found.k.tolist() == [n, n + 1]
    assert found.error == 1.0
    assert found.proven


def test_the_dual_bound_of_long_lists_is_not_rounded_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("labeller.optimal._PIXELS", 0)  # the bound is that of the price alone
    n, most = 300_000, 9.0 * 300_000
    curves = curves_of([[*[most] * n, 1.0, 0.0]] * 2 + [[*[most] * n, 1 + 2**-23, 2**-23 - 2e-11, 0.0]])
    best = 1.0 + float(np.float32(2**-23 - 2e-11))
    (found,) = allocate_curves(dump_for(curves), curves, [3 * n + 2], "optimal")
    assert found.lam == 1.0
    assert 1 - 1e-12 < (found.bound or 0.0) / best <= 1 + 1e-14
    assert not found.proven


def test_equal_pixels_by_the_thousand_are_no_trouble() -> None:
    # Every step ties with every other and none fits what is left: the worst case of the remainder.
    curves = curves_of([[1.0, 0.95, 0.9, 0.0]] * 5000)
    for budget, error in ((7, 5000 - 2 - 0.05), (9000, 2000.0), (9001, 2000 - 0.05), (9002, 2000 - 0.1), (14999, 0.9)):
        (found,) = allocate_curves(dump_for(curves), curves, [budget], "optimal")
        assert found.error == pytest.approx(error, rel=1e-6)
        assert found.proven


def test_a_picture_of_equal_lists_is_proven() -> None:
    rng = np.random.default_rng(4)
    kinds = [(rng.integers(1, 255, (40, 4), dtype=np.uint8), np.arange(1, 41, dtype=np.float32)) for _ in range(3)]
    curves = error_curves(dump_of([kinds[i % 3] for i in range(3000)]))
    total = int(curves.counts.sum())
    budgets = [int(share * total) + 1 for share in (0.25, 0.4, 0.6, 0.8)]
    for found in allocate_curves(dump_for(curves), curves, budgets, "optimal"):
        assert found.proven
        assert dual_bound(curves, found.lam or 0.0, found.budget) <= found.error * (1 + 1e-9)


dumps = st.builds(
    random_dump,
    width=st.integers(1, 6),
    height=st.integers(1, 40),
    max_n=st.sampled_from([0, 1, 3, 12]),
    seed=st.integers(0, 2**16),
    alpha=st.sampled_from([None, 1 / 255, 0.5]),
)


def bands_of(dump: FragmentDump, rows: int) -> list[FragmentDump]:
    """A view's row bands of some rows each, whole tiles, with their tiles' ranges."""
    made, columns, ranges = [], tile_grid(dump.width, dump.height)[0], tile_ranges(dump)
    for y in range(0, dump.height, rows):
        p, q = y * dump.width, min(y + rows, dump.height) * dump.width
        i, j = dump.offsets[p], dump.offsets[q]
        made.append(
            FragmentDump(
                *(dump.width, (q - p) // dump.width, dump.offsets[p : q + 1] - i),
                *(dump.rgba[i:j], dump.depth[i:j], dump.background[p:q], dump.facing[p:q]),
                tile_range=ranges[y // RANGE_TILE * columns : -(-(y + rows) // RANGE_TILE) * columns],
            )
        )
    return made


@settings(max_examples=80, deadline=None)
@given(dumps, st.sampled_from([8, 16, 24]), st.sampled_from(["optimal", "greedy", "increment"]))
def test_row_bands_give_what_the_whole_view_gives(dump: FragmentDump, rows: int, rule: ErrorRule) -> None:
    occupied, total = int(np.count_nonzero(dump.counts)), dump.total
    budgets = [max(0, F) for F in (0, occupied - 1, occupied, total // 2, total // 2, total - 1, total + 3)]
    bands = bands_of(dump, rows)
    whole = allocate_curves(dump, error_curves(dump), budgets, rule)
    for found, expected in zip(allocate_bands(lambda: iter(bands), budgets, rule), whole, strict=True):
        assert np.array_equal(found.k, expected.k)
        assert found.error == pytest.approx(expected.error, rel=1e-12)
        assert (found.exact, found.used) == (expected.exact, expected.used)
        assert found.bound == (None if rule != "optimal" else pytest.approx(expected.bound, rel=1e-9))


def test_row_bands_refuse_what_they_cannot_do() -> None:
    for budgets, rule in (([5], "fixed"), ([2.5], "optimal"), ([-1], "greedy")):
        with pytest.raises(Problem):
            allocate_bands(lambda: bands_of(random_dump(4, 4, 3, seed=0), 8), budgets, rule)  # type: ignore[arg-type]


@settings(max_examples=60, deadline=None)
@given(dumps, st.lists(st.floats(0.0, 4.0), min_size=1, max_size=5), st.sampled_from(METRICS))
def test_several_g_at_once_give_what_each_gives_alone(dump: FragmentDump, gs: list[float], metric: MetricName) -> None:
    for g, found in zip(gs, error_curves_by_g(dump, gs, metric), strict=True):
        alone = error_curves(dump, "density", g, metric)
        assert np.array_equal(found.error, alone.error)
        assert (found.g, found.tail, found.metric) == (alone.g, alone.tail, alone.metric)


@settings(max_examples=60, deadline=None)
@given(dumps, st.integers(0, 2**16))
def test_weights_multiply_the_errors_of_their_pixel(dump: FragmentDump, seed: int) -> None:
    weights = np.random.default_rng(seed).choice([0.0, 1e-6, 1.0, 37.5], dump.pixels)
    plain, weighted = error_curves(dump), error_curves(dump, weights=weights)
    expected = plain.error * np.repeat(weights, dump.counts + 1)
    np.testing.assert_allclose(weighted.error, expected, rtol=2e-7)
