"""Invariants of METHOD section 6 for every rule, on random views."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.dumps import random_dump

from labeller.allocation import RULES, RuleName
from labeller.curves import UNREACHABLE, error_curves, whole_bins
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from schemas.fragments import FragmentDump
from schemas.tail import BINNED_TAILS, METRICS, TAIL_NAMES, MetricName, TailName

pytestmark = pytest.mark.usefixtures("single_thread")


dumps = st.builds(
    random_dump,
    width=st.integers(1, 8),
    height=st.integers(1, 8),
    max_n=st.sampled_from([0, 1, 2, 6, 40]),
    seed=st.integers(0, 2**16),
    alpha=st.sampled_from([None, 1 / 255, 0.33, 0.5, 254 / 255]),
)
spending = [rule for rule in RULES if rule not in ("fixed", "dynamic", "optimal")]


def budgets_of(dump: FragmentDump) -> list[int]:
    occupied, total = int(np.count_nonzero(dump.counts)), dump.total
    return sorted({max(0, f) for f in (0, occupied - 1, occupied, total // 2, total - 1, total, 2 * total)})


@settings(max_examples=60, deadline=None)
@given(dumps, st.sampled_from(RULES), st.sampled_from(TAIL_NAMES), st.sampled_from(METRICS))
def test_every_allocation_keeps_its_limits(
    dump: FragmentDump, rule: RuleName, tail: TailName, metric: MetricName
) -> None:
    curves = error_curves(dump, tail, metric=metric)
    for found in allocate_curves(dump, curves, budgets_of(dump), rule):
        assert found.used == found.k.sum() <= found.budget
        assert (found.k <= dump.counts).all()
        assert found.k.min(initial=0) >= 0
        if rule in spending:
            assert found.used == min(found.budget, dump.total)
        assert np.isfinite(found.error)
        assert found.error == pytest.approx(curves.total(found.k), rel=1e-13)
        assert found.exact == (found.budget >= dump.total)


@settings(max_examples=60, deadline=None)
@given(dumps, st.sampled_from(TAIL_NAMES))
def test_nothing_is_better_than_optimal_and_nothing_beats_its_bound(dump: FragmentDump, tail: TailName) -> None:
    curves, budgets = error_curves(dump, tail), budgets_of(dump)
    optimal = allocate_curves(dump, curves, budgets, "optimal")
    for rule in RULES:
        for best, other in zip(optimal, allocate_curves(dump, curves, budgets, rule), strict=True):
            assert best.bound <= best.error
            if rule in ("greedy", "increment"):
                assert best.error <= other.error * (1 + 1e-12)
            assert best.bound <= other.error * (1 + 1e-12)


@settings(max_examples=100, deadline=None)
@given(dumps, st.sampled_from(TAIL_NAMES), st.lists(st.floats(0.0, 1.1), max_size=8))
def test_neither_the_optimums_error_nor_its_bound_rises_with_the_budget(
    dump: FragmentDump, tail: TailName, shares: list[float]
) -> None:
    budgets = sorted({*budgets_of(dump), *(int(share * dump.total) for share in shares)})
    found = allocate_curves(dump, error_curves(dump, tail), budgets, "optimal")
    for values in ([x.error for x in found], [x.bound for x in found]):
        here = np.array(values)
        assert (here[1:] <= here[:-1] * (1 + 1e-12)).all()


@settings(max_examples=60, deadline=None)
@given(dumps, st.sampled_from(BINNED_TAILS), st.lists(st.floats(0.0, 1.1), max_size=8))
def test_the_optimum_of_whole_bins_never_rises_with_the_budget_nor_beats_any_ks_bound(
    dump: FragmentDump, tail: TailName, shares: list[float]
) -> None:
    budgets = sorted({*budgets_of(dump), *(int(share * dump.total) for share in shares)})
    curves = error_curves(dump, tail)
    cuts = whole_bins(dump, curves)
    found, free = (allocate_curves(dump, each, budgets, "optimal") for each in (cuts, curves))
    for values in ([x.error for x in found], [x.bound for x in found]):
        here = np.array(values)
        assert (here[1:] <= here[:-1] * (1 + 1e-12)).all()
    for of_cuts, of_any in zip(found, free, strict=True):
        assert of_cuts.used <= of_cuts.budget
        assert (cuts.at(of_cuts.k) < UNREACHABLE).all()
        assert of_any.bound <= of_cuts.error * (1 + 1e-12)


@settings(max_examples=60, deadline=None)
@given(dumps, st.sampled_from(TAIL_NAMES))
def test_hulls_are_convex_and_below_their_curves(dump: FragmentDump, tail: TailName) -> None:
    curves = error_curves(dump, tail)
    hulls = lower_hulls(curves)
    for p in range(dump.pixels):
        curve = curves.error[curves.offsets[p] : curves.offsets[p + 1]].astype(np.float64)
        k = hulls.k[hulls.offsets[p] : hulls.offsets[p + 1]]
        error = hulls.error[hulls.offsets[p] : hulls.offsets[p + 1]].astype(np.float64)
        if not len(k):
            assert curve[0] == 0.0
            continue
        assert (k[0], error[-1]) == (0, 0.0)
        assert np.array_equal(error, curve[k])
        slopes = -np.diff(error) / np.diff(k)
        assert (slopes > 0.0).all()
        assert (np.diff(slopes) <= 1e-12 * slopes[:-1]).all()
        between = np.interp(np.arange(len(curve)), k, error)
        assert (between <= curve * (1 + 1e-9) + 1e-30).all()


def test_the_error_does_not_rise_with_the_budget_on_a_view() -> None:
    dump = random_dump(60, 40, 9, seed=7)
    curves = error_curves(dump)
    occupied = int(np.count_nonzero(dump.counts))
    budgets = np.linspace(occupied, dump.total, 25).astype(int).tolist()
    for rule in ("greedy", "optimal"):
        errors = np.array([x.error for x in allocate_curves(dump, curves, budgets, rule)])
        assert (np.diff(errors) <= 1e-4 * errors[:-1]).all(), rule
    assert max(x.gap for x in allocate_curves(dump, curves, budgets[:-1], "optimal")) < 1e-3


@pytest.mark.parametrize("alpha", [1 / 255, 0.5, 254 / 255])
def test_lists_of_thousands_keep_the_limits(alpha: float) -> None:
    dump = random_dump(2, 2, 4096, seed=1, alpha=alpha)
    curves = error_curves(dump)
    for rule in RULES:
        (found,) = allocate_curves(dump, curves, [dump.total // 2], rule)
        assert found.used <= found.budget
        assert np.isfinite(found.error)
