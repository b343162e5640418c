"""Allocations on cases that can be worked out by hand."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from support.curves import curves_of, dump_for
from support.dumps import random_dump

from labeller.allocation import RULES, RuleName
from labeller.baselines import fixed
from labeller.curves import error_curves
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from schemas.tail import TAILS, TailName

COUNTER_EXAMPLE = curves_of([[0.5, 0.05, 0.0], [0.5, 0.06, 0.04, 0.0]])


@pytest.mark.parametrize(("rule", "k", "error"), [("greedy", [1, 2], 0.09), ("optimal", [2, 1], 0.06)])
def test_removing_two_of_the_counter_example(rule: RuleName, k: list[int], error: float) -> None:
    (found,) = allocate_curves(dump_for(COUNTER_EXAMPLE), COUNTER_EXAMPLE, [3], rule)
    assert found.k.tolist() == k
    assert found.error == pytest.approx(error)
    assert found.used == 3


def test_the_optimum_of_the_counter_example_is_certified() -> None:
    (found,) = allocate_curves(dump_for(COUNTER_EXAMPLE), COUNTER_EXAMPLE, [3], "optimal")
    assert found.bound is not None
    assert found.gap == pytest.approx((found.error - found.bound) / found.error)
    assert found.bound <= 0.06


def test_the_remainder_buys_the_best_upgrade_that_fits() -> None:
    # The hull's next step of pixel 0 costs 3 and does not fit in 2; two single ones of pixel 1 and 2 do.
    curves = curves_of([[3.0, 2.9, 2.8, 0.0], [0.5, 0.0], [0.4, 0.0]])
    assert allocate_curves(dump_for(curves), curves, [2], "optimal")[0].k.tolist() == [0, 1, 1]
    # Here the point inside of that step is worth more than either.
    curves = curves_of([[9.0, 6.2, 6.1, 0.0], [0.5, 0.0], [0.4, 0.0]])
    assert allocate_curves(dump_for(curves), curves, [2], "optimal")[0].k.tolist() == [1, 1, 0]


@pytest.mark.parametrize("rule", RULES)
def test_a_budget_for_all_fragments_decides_nothing(rule: RuleName) -> None:
    dump = random_dump(8, 8, 5, seed=1)
    curves = error_curves(dump)
    for found in allocate_curves(dump, curves, [dump.total, 2 * dump.total], rule):
        assert found.exact
        assert np.array_equal(found.k, dump.counts)
        assert (found.used, found.error) == (dump.total, 0.0)


@pytest.mark.parametrize("rule", RULES)
def test_no_budget_leaves_everything_to_the_tail(rule: RuleName) -> None:
    dump = random_dump(8, 8, 5, seed=1)
    curves = error_curves(dump)
    (found,) = allocate_curves(dump, curves, [0], rule)
    assert found.used == 0
    assert found.error == pytest.approx(float(curves.error[curves.offsets[:-1]].sum()))


@pytest.mark.parametrize("rule", ["increment", "optimal", "importance", "proportional"])
def test_pixels_may_be_left_to_their_tail_at_any_budget(rule: RuleName) -> None:
    dump = random_dump(8, 8, 5, seed=1)
    occupied = int(np.count_nonzero(dump.counts))
    (found,) = allocate_curves(dump, error_curves(dump), [occupied], rule)
    assert (found.k[dump.counts > 0] == 0).any()


def test_algorithm_1_keeps_one_fragment_of_every_occupied_pixel_where_the_budget_covers_it() -> None:
    dump = random_dump(8, 8, 5, seed=1)
    occupied = int(np.count_nonzero(dump.counts))
    below, at, above = allocate_curves(dump, error_curves(dump), [occupied - 1, occupied, occupied + 9], "greedy")
    assert (below.k[dump.counts > 0] == 0).any()
    assert np.array_equal(at.k, np.minimum(dump.counts, 1))
    assert (above.k >= np.minimum(dump.counts, 1)).all()


@pytest.mark.parametrize("tail", TAILS)
def test_one_fragment_is_exact_without_a_core_unless_the_tail_lacks_its_opacity_factor(tail: TailName) -> None:
    dump = random_dump(40, 40, 1, seed=3)
    curves = error_curves(dump, tail)
    alone = curves.error[curves.offsets[:-1][dump.counts == 1]]
    assert len(alone)
    assert (alone > 0.0).any() == (tail == "paper")
    (found,) = allocate_curves(dump, curves, [dump.total // 2], "optimal")
    assert (found.error > 0.0) == (tail == "paper")


@pytest.mark.parametrize("rule", RULES)
def test_several_budgets_give_what_each_gives_alone(rule: RuleName) -> None:
    dump = random_dump(12, 12, 7, seed=2)
    curves, hulls = error_curves(dump), lower_hulls(error_curves(dump))
    budgets = [dump.total // 2, 30, dump.total // 3, dump.total + 1]
    together = allocate_curves(dump, curves, budgets, rule, hulls)
    for budget, found in zip(budgets, together, strict=True):
        assert np.array_equal(found.k, allocate_curves(dump, curves, [budget], rule)[0].k)
        assert found.budget == budget


def test_a_budget_beyond_all_gains_is_not_spent() -> None:
    curves = curves_of([[1.0, 0.5, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    (found,) = allocate_curves(dump_for(curves), curves, [5], "optimal")
    assert found.k.tolist() == [2, 0]
    assert (found.error, found.gap, found.lam) == (0.0, 0.0, 0.0)


def test_an_empty_view_has_an_empty_allocation() -> None:
    dump = random_dump(4, 4, 0, seed=0)
    for rule in RULES:
        (found,) = allocate_curves(dump, error_curves(dump), [10], rule)
        assert found.exact
        assert not found.k.any()


def test_a_negative_budget_is_refused() -> None:
    dump = random_dump(2, 2, 2, seed=0)
    with pytest.raises(ValueError, match="negative"):
        allocate_curves(dump, error_curves(dump), [-1], "greedy")


def test_fixed_counts_every_pixel() -> None:
    assert fixed(np.array([0, 0, 1, 2, 5, 9]), 12).tolist() == [0, 0, 1, 2, 2, 2]


def test_hulls_have_their_lower_points_and_no_flat_end() -> None:
    hulls = lower_hulls(curves_of([[9.0, 7.0, 2.0, 3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [4.0, 0.0], [0.0]]))
    assert hulls.offsets.tolist() == [0, 3, 3, 5, 5]
    assert hulls.k.tolist() == [0, 2, 4, 0, 1]
    assert hulls.error.tolist() == [9.0, 2.0, 0.0, 4.0, 0.0]
    slopes, lengths = hulls.steps()
    assert slopes.tolist() == [np.inf, 3.5, 1.0, np.inf, 4.0]
    assert lengths.tolist() == [0, 2, 2, 0, 1]


def test_the_papers_fill_wastes_budget() -> None:
    dump = random_dump(16, 16, 7, seed=3)
    curves = error_curves(dump)
    budget = dump.total // 2
    (paper,) = allocate_curves(dump, curves, [budget], "importance", fill="paper")
    (exact,) = allocate_curves(dump, curves, [budget], "importance")
    assert paper.used < 0.95 * budget
    assert exact.used == budget


def test_a_hundred_budgets_give_what_each_gives_alone() -> None:
    dump = random_dump(30, 20, 9, seed=5)
    curves = error_curves(dump)
    budgets = np.linspace(0, dump.total, 100).astype(int).tolist()
    for rule in ("optimal", "greedy"):
        together = allocate_curves(dump, curves, budgets, rule)
        for budget, found in list(zip(budgets, together, strict=True))[::9]:
            assert np.array_equal(found.k, allocate_curves(dump, curves, [budget], rule)[0].k)
        errors = [x.error for x in together]
        assert rule == "greedy" or all(b <= a * (1 + 1e-12) for a, b in pairwise(errors))
