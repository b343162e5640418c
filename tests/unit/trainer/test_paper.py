"""DHOIT's network: inputs and labels as printed, and what the repaired preset does otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.training import random_paper_view, random_view, random_weights

from schemas.problem import Problem
from trainer.config import Preset
from trainer.dataset import GROUP, Drawing, ViewData
from trainer.evaluate import evaluate, geometric_mean
from trainer.paper import PAPER_FEATURES, importance_counts, paper_batch, paper_inputs
from trainer.train import TrainConfig, train

STEPS = 1200


@pytest.fixture(scope="module")
def views() -> list[ViewData]:
    return [random_paper_view("a", 1), random_paper_view("b", 2)]


def test_inputs_are_those_of_the_paper_in_its_order(views: list[ViewData]) -> None:
    view = views[0]
    assert view.paper is not None
    inputs = dict(zip(PAPER_FEATURES, paper_inputs(view, slice(None), 300).T, strict=True))
    assert len(inputs) == 12
    np.testing.assert_allclose(inputs["n_share"], view.n / view.paper.fragments)
    np.testing.assert_allclose(inputs["budget_share"], 300 / view.paper.fragments)
    assert (inputs["depth_near"] <= inputs["depth_far"]).all()
    for depth in (inputs["depth_near"], inputs["depth_far"]):
        assert (depth >= inputs["scene_depth_near"] - 1e-6).all()
        assert (depth <= inputs["scene_depth_far"] + 1e-6).all()
    assert 0.0 < inputs["scene_depth_near"][0] < inputs["scene_depth_far"][0] < 1.0
    assert (inputs["rgb_nearest_g"] >= 0.0).all()


def test_labels_are_what_the_optimum_spends(views: list[ViewData]) -> None:
    """At the price of a budget the optimum's counts sum to the budget, but for the segment at the price itself."""
    view = views[0]
    assert view.paper is not None
    inputs, counts, budgets, share = paper_batch([view], (0, 0), 400 * GROUP, Drawing())
    assert share == 1.0
    levels = {int(budget) for budget in budgets[:, 0]}
    assert levels == set(view.paper.budgets)
    for budget in levels:
        at = budgets[:, 0] == budget
        single = view.paper.fragments - view.n.sum()  # pixels of one fragment are no rows
        assert counts[at].mean() * view.rows + single == pytest.approx(budget, rel=0.03)
        np.testing.assert_allclose(inputs[at, 1], budget / view.paper.fragments, rtol=1e-6)


def test_two_processes_share_a_batch(views: list[ViewData]) -> None:
    whole, *parts = (
        paper_batch(views, (3, 1), 3 * GROUP, drawing)
        for drawing in (Drawing(), Drawing(rank=0, size=2), Drawing(rank=1, size=2))
    )
    assert [part[3] for part in parts] == [2 / 3, 1 / 3]
    groups = [parts[0][0][:GROUP], parts[1][0], parts[0][0][GROUP:]]
    np.testing.assert_array_equal(np.concatenate(groups), whole[0])


def test_as_printed_it_becomes_a_constant_and_repaired_it_learns(views: list[ViewData]) -> None:
    spread, correlation = {}, {}
    for preset in ("paper", "paper-repaired"):
        config = TrainConfig.of(preset, steps=STEPS, validate_every=STEPS)
        weights = train(views, (), config).weights
        inputs, counts, *_ = paper_batch(views, (9, 9), 40 * GROUP, Drawing())
        importance = weights.answer(inputs)[:, 0]
        spread[preset] = importance.std() / importance.mean()
        correlation[preset] = np.corrcoef(importance, counts)[0, 1]
    assert spread["paper"] < 1e-4 < 0.1 < spread["paper-repaired"]
    assert correlation["paper-repaired"] > 0.4


@pytest.mark.parametrize("fill", ["paper", "budget"])
def test_counts_keep_to_budget_and_pixels(fill: str, views: list[ViewData]) -> None:
    weights = train(views, (), TrainConfig.of("paper-repaired", steps=1)).weights
    view = views[1]
    budget = int(0.5 * view.n.sum())
    k = importance_counts(weights, view, 0, budget, fill)  # type: ignore[arg-type]
    assert (k >= 0).all()
    assert (k <= view.n).all()
    assert int(k.sum()) == budget if fill == "budget" else int(k.sum()) < budget


def test_both_fills_are_scored_against_the_optimum(views: list[ViewData]) -> None:
    weights = train(views, (), TrainConfig.of("paper-repaired", steps=1)).weights
    printed, filled = (geometric_mean(evaluate(weights, views, fill)) for fill in ("paper", "budget"))
    assert 1.0 <= filled < printed


def _unscored(view: ViewData) -> ViewData:
    """A view whose budgets suffice with fragments to spare: none of them has a price."""
    assert view.paper is not None
    return replace(view, asset="c", anchors=np.zeros(0), paper=replace(view.paper, budgets=()))


@pytest.mark.parametrize("preset", ["paper", "paper-repaired"])
def test_a_view_without_a_price_changes_nothing(preset: Preset, views: list[ViewData]) -> None:
    config = TrainConfig.of(preset, steps=3, validate_every=3)
    alone, beside = (train(given, (), config).weights for given in (views, [*views, _unscored(views[0])]))
    assert alone.digest() == beside.digest()


@pytest.mark.parametrize("preset", ["paper", "paper-repaired"])
def test_views_without_any_price_are_refused(preset: Preset, views: list[ViewData]) -> None:
    config, unscored = TrainConfig.of(preset, steps=1), [_unscored(views[0])]
    with pytest.raises(Problem, match=r"scored at a budget"):
        train(unscored, (), config)
    with pytest.raises(Problem, match=r"No validation view is scored"):
        train(views, unscored, config)


def test_rows_without_depths_are_refused() -> None:
    with pytest.raises(Problem, match="do not know the depths"):
        train([random_view("a", 1)], (), TrainConfig.of("paper", steps=1))


def test_gains_of_bins_are_no_beginning_of_an_importance(views: list[ViewData]) -> None:
    with pytest.raises(Problem, match="cannot be trained as paper"):
        train(views, (), TrainConfig.of("paper", steps=1), start=random_weights(0))
