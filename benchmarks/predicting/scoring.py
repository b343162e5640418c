"""Scores of a variant on the assets that its networks have not seen.

`q = (MSE + 1e-7) / (MSE of the oracle + 1e-7)` for a view and a budget F = W H x 1, 2, 4 below N: the oracle is DHOIT's
Algorithm 1, offline, with its own tail. Every pixel is predicted, and the error is the tail's, not that of a hull.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.predicting.cost import Cost, gather_costs, memory_of, network_cost, rule_cost
from benchmarks.predicting.feedback import corrected, observed
from benchmarks.predicting.inputs import BLOCKS, changed
from benchmarks.predicting.labels import labels_of, oracle_of
from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.training import Trainings
from benchmarks.predicting.variants import Variant
from benchmarks.predicting.views import ViewRow, load_dump
from labeller.curves import Curves
from renderer.allocation.fill import budget_fill, paper_fill, solve_lambda
from renderer.features import derive, gather
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_BINS
from trainer.dataset import LOSSLESS_MSE, make_view
from trainer.paper import paper_inputs, with_paper_inputs
from trainer.weights import Weights

Row = dict[str, Any]
Allocate = Callable[[int], NDArray[np.int32]]
"""Core fragments of every pixel, int32 [P], from a budget."""


def ratio(mse: float, other: float) -> float:
    """How many times one error is another, after what counts as lossless was added to both."""
    return (mse + LOSSLESS_MSE) / (other + LOSSLESS_MSE)


def scores_of(trainings: Trainings, variant: Variant) -> list[Row]:
    """A row for each view: q at its budgets, at equal total memory, and relative to the tail's optimum.

    Args:
        trainings: Gives the networks.
        variant: What is scored.
    """
    found: list[Row] = []
    for fold in trainings.folds:
        key = score_key(trainings, variant, fold)
        found += trainings.store.remember("scores", key, partial(_score_fold, trainings, variant, fold))
    return found


def score_key(trainings: Trainings, variant: Variant, fold: int) -> str:
    """Of everything that decides the scores of a fold."""
    store = trainings.store
    scored = [labels_of(store, row, variant.tail).key for row in trainings.rows if not trainings.sees(row, fold)]
    costs = asdict(rule_cost(variant.tail, True)), gather_costs(variant.tail)
    about = (variant.tail, variant.inputs, variant.feedback, variant.turns, *costs)
    return key_of(trainings.key(variant, fold), about, scored, store.code("scores"), store.code("labels"))


def _score_fold(trainings: Trainings, variant: Variant, fold: int) -> list[Row]:
    weights = trainings.network(variant, fold)
    cost = network_cost(weights, variant.tail, BLOCKS.get(variant.inputs, 1))
    unseen = [row for row in trainings.rows if not trainings.sees(row, fold)]
    return [_score_view(trainings.store, row, variant, weights, cost) for row in unseen]


def _score_view(store: Store, row: ViewRow, variant: Variant, weights: Weights, cost: Cost) -> Row:
    dump, labels = load_dump(store, row), labels_of(store, row, variant.tail)
    curves = labels.curves(dump)
    allocate = allocation_of(variant, weights, dump, curves)

    def mse(budget: int) -> float:
        return curves.total(allocate(budget)) / (3 * row.pixels)

    return scored_row(row, oracle_of(store, row), labels.mse["optimal"], cost, mse)


def scored_row(row: ViewRow, oracle: list[float], optimum: list[float], cost: Cost, mse: Callable[[int], float]) -> Row:
    """The figures of a view.

    Args:
        row: The view.
        oracle: Mean squared errors of the oracle at the view's budgets.
        optimum: Those of the tail's optimum.
        cost: What the variant costs a pixel.
        mse: Mean squared error of what it makes of a budget.
    """
    # A view's oracle pays for nothing: it has F whatever the others' memory.
    budgets = [cost.budget(memory_of(m, row.pixels), row.pixels) for m in row.multiples]
    within = [None if budget is None else mse(budget) for budget in budgets]
    errors = [mse(budget) for budget in row.budgets]
    return {
        "asset": row.asset,
        "mode": row.mode,
        "view": row.view,
        "multiples": row.multiples,
        "mse": errors,
        "q": [ratio(e, o) for e, o in zip(errors, oracle, strict=True)],
        "of optimum": [ratio(e, o) for e, o in zip(errors, optimum, strict=True)],
        "at memory": [None if e is None else ratio(e, o) for e, o in zip(within, oracle, strict=True)],
    }


def allocation_of(variant: Variant, weights: Weights, dump: FragmentDump, curves: Curves) -> Allocate:
    """How a variant spends budgets on a view.

    Args:
        variant: What is scored.
        weights: Its network.
        dump: The view.
        curves: Of the variant's tail; only feedback reads them.
    """
    features = derive(gather(dump, DENSITY_BINS.get(variant.tail, 0)))
    if weights.head == "importance":
        fill = "paper" if variant.config.preset == "paper" else "budget"
        return _importance(weights, dump, features, fill)
    n = dump.counts.astype(np.int32)
    a, b = np.zeros(dump.pixels), np.ones(dump.pixels)
    covered = n > 0
    a[covered], b[covered] = weights.predict(changed(features, variant.inputs, dump.width)[covered])

    def spend(budget: int) -> NDArray[np.int32]:
        gains, k = a, gain_counts(a, b, n, budget)
        for _ in range(variant.turns if variant.feedback is not None else 0):
            assert variant.feedback is not None
            gains = corrected(gains, b, k, observed(variant.feedback, dump, curves, k))
            k = gain_counts(gains, b, n, budget)
        return k

    return spend


def gain_counts(
    a: NDArray[np.floating], b: NDArray[np.floating], n: NDArray[np.int32], budget: int
) -> NDArray[np.int32]:
    """Core fragments that gain curves stand for at a budget, as `kbuffer-deep` finds them.

    Args:
        a: [P], log gain of the first fragment.
        b: [P], decay per fragment.
        n: int32 [P], fragments.
        budget: F.

    Returns:
        int32 [P], `sum k = min(F, N)`.
    """
    k = np.zeros(len(n), dtype=np.int32)
    occupied = np.flatnonzero(n)
    k[occupied] = solve_lambda(a[occupied], b[occupied], n[occupied], budget)[0]
    return k


def _importance(weights: Weights, dump: FragmentDump, features: NDArray[np.float32], fill: str) -> Allocate:
    n = dump.counts.astype(np.int32)
    covered = np.flatnonzero(n)
    view = make_view(
        "",
        features=features[covered],
        n=n[covered],
        hull=(np.zeros(len(covered) + 1, np.int64), np.zeros(0, np.int32), np.zeros(0, np.float32)),
        price_range=(0.0, 0.0),
        anchors=(),
        sampled_pixels=float(dump.pixels),
    )

    def spend(budget: int) -> NDArray[np.int32]:
        inputs = paper_inputs(with_paper_inputs(view, dump, covered, [budget]), slice(None), budget)
        k = np.zeros(dump.pixels, dtype=np.int32)
        importance = weights.answer(inputs)[:, 0]
        if fill == "budget":
            k[covered] = budget_fill(importance, n[covered], budget)
        else:
            k[covered] = np.minimum(paper_fill(importance, budget), n[covered])  # Eq. 3: slots beyond n stay empty
        return k

    return spend
