"""Scores of a variant on the assets that its networks have not seen.

`q = (MSE + 1e-7) / (MSE of the oracle + 1e-7)` for a view and a budget F: the oracle is DHOIT's Algorithm 1, offline,
with its own tail. A view is scored by what a frame does: every pixel is predicted, whole bins are chosen within the
budget by the frame's own rule, and the error is the tail's at those cuts, not that of a hull between them.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from benchmarks.predicting.cuts import core_of, frame_events
from benchmarks.predicting.labels import OPTIMUM, RIVALS, labels_of, oracle_of
from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.training import Trainings
from benchmarks.predicting.variants import Variant
from benchmarks.predicting.views import ViewRow, load_dump
from trainer.dataset import LOSSLESS_MSE
from trainer.weights import Weights

Row = dict[str, Any]

MARGIN = 1.05
"""An error of so many times that of the best rule without a network counts as worse than it."""


def ratio(mse: float, other: float) -> float:
    """How many times one error is another, after what counts as lossless was added to both."""
    return (mse + LOSSLESS_MSE) / (other + LOSSLESS_MSE)


def is_worse(mse: float, rival: float) -> bool:
    """Whether an error is worse than another, by more than `MARGIN`, and one of them is seen at all."""
    return mse > MARGIN * rival and max(mse, rival) > LOSSLESS_MSE


def scores_of(trainings: Trainings, variant: Variant) -> list[Row]:
    """A row for each view that is scored.

    Args:
        trainings: Gives the networks.
        variant: What is scored.
    """
    found: list[Row] = []
    for fold in trainings.folds:
        found += trainings.store.remember(
            "scores", score_key(trainings, variant, fold), partial(_score_fold, trainings, variant, fold)
        )
    return found


def score_key(trainings: Trainings, variant: Variant, fold: int) -> str:
    """Of everything that decides the scores of a fold."""
    store = trainings.store
    scored = [labels_of(store, row, variant.tail).key for row in trainings.unseen(fold)]
    return key_of(trainings.key(variant, fold), variant.tail, scored, store.code("scores"))


def _score_fold(trainings: Trainings, variant: Variant, fold: int) -> list[Row]:
    weights = trainings.network(variant, fold)
    return [_score_view(trainings.store, row, variant, weights) for row in trainings.unseen(fold)]


def _score_view(store: Store, row: ViewRow, variant: Variant, weights: Weights) -> Row:
    dump, labels, oracle = load_dump(store, row), labels_of(store, row, variant.tail), oracle_of(store, row)
    curves = labels.curves(dump)
    occupied, events = frame_events(dump, variant.tail, weights)
    errors = [curves.total(core_of(dump, occupied, events, budget)) / (3 * row.pixels) for budget in row.budgets]
    best = [min(labels.mse[rule][i] for rule in RIVALS) for i in range(len(errors))]
    return {
        **facts_of(row),
        "mse": errors,
        "q": [ratio(e, o) for e, o in zip(errors, oracle, strict=True)],
        "of optimum": [ratio(e, o) for e, o in zip(errors, labels.mse[OPTIMUM], strict=True)],
        "worse": [is_worse(e, r) for e, r in zip(errors, best, strict=True)],
    }


def facts_of(row: ViewRow) -> Row:
    """What tells a view's row from others, and at which budgets its figures are."""
    return {"asset": row.asset, "mode": row.mode, "view": row.view, "multiples": row.multiples}
