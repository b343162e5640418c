"""Training and scores of networks with a third output (`benchmarks.predicting.factors`), on unseen assets."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.predicting.cost import Cost, network_cost
from benchmarks.predicting.factors import (
    ANSWER_BYTES,
    FACTORS,
    FactorHead,
    FactorLabels,
    errors_of,
    exponents_of,
    factor_labels,
    factor_view,
    start_of,
)
from benchmarks.predicting.labels import oracle_of
from benchmarks.predicting.scoring import Row, gain_counts, score_key, scored_row
from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.training import Trainings
from benchmarks.predicting.variants import Variant
from benchmarks.predicting.views import ViewRow, load_dump
from renderer.features import derive, gather
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_BINS
from trainer.train import train
from trainer.weights import Weights, load_weights, save_weights


def factor_scores(trainings: Trainings, variant: Variant) -> list[Row]:
    """A row for each view, as of `benchmarks.predicting.scoring.scores_of`; the optimum's factors are the best too."""
    found: list[Row] = []
    for fold in trainings.folds:
        key = key_of(score_key(trainings, variant, fold), FACTORS, trainings.store.code("factors"))
        found += trainings.store.remember("scores", key, partial(_score_fold, trainings, variant, fold))
    return found


def factor_network(trainings: Trainings, variant: Variant, fold: int) -> Weights:
    """The network that has not seen a fold's assets; trained where it is not there."""
    store = trainings.store
    key = key_of(trainings.key(variant, fold), FACTORS, store.code("factors"))
    path = store.path("networks", f"{key}.safetensors")
    if not path.exists():
        seen = [row for row in trainings.rows if trainings.sees(row, fold)]
        views = [factor_view(factor_labels(store, row, variant.tail), row.asset) for row in seen]
        head = FactorHead(start_of(variant.tail))
        weights = train([view for view in views if view.rows], (), variant.config, head=head).weights
        store.write(path, lambda part: save_weights(part, weights))
    return load_weights(path)


def factor_cost(weights: Weights, variant: Variant) -> Cost:
    """That of the network, and of its third answer: tails are mixed with it while fragments are captured."""
    cost = network_cost(weights, variant.tail)
    return replace(cost, gather_bytes=cost.gather_bytes + ANSWER_BYTES, capture_bytes=cost.capture_bytes + ANSWER_BYTES)


def answered(weights: Weights, dump: FragmentDump, bins: int) -> NDArray[np.float32]:
    """a, b and the factor of every pixel, float32 [P, 3]; of one without fragments 0, 1 and 0."""
    found = np.tile(np.array([0.0, 1.0, 0.0], np.float32), (dump.pixels, 1))
    covered = dump.counts > 0
    found[covered] = weights.run(derive(gather(dump, bins))[covered])
    found[:, 2] = np.minimum(found[:, 2], FACTORS[-1])
    return found


def _score_fold(trainings: Trainings, variant: Variant, fold: int) -> list[Row]:
    weights, store = factor_network(trainings, variant, fold), trainings.store
    cost = factor_cost(weights, variant)
    unseen = [row for row in trainings.rows if not trainings.sees(row, fold)]
    return [_score_view(store, row, variant, weights, cost, factor_labels(store, row, variant.tail)) for row in unseen]


def _score_view(
    store: Store, row: ViewRow, variant: Variant, weights: Weights, cost: Cost, labels: FactorLabels
) -> Row:
    dump = load_dump(store, row)
    a, b, factor = answered(weights, dump, DENSITY_BINS.get(variant.tail, 0)).T
    errors = errors_of(dump, exponents_of(dump, variant.tail), factor)
    at = dump.offsets[:-1] + np.arange(dump.pixels)
    n = dump.counts.astype(np.int32)

    def mse(budget: int) -> float:
        return float(errors[at + gain_counts(a, b, n, budget)].sum(dtype=np.float64)) / (3 * row.pixels)

    return scored_row(row, oracle_of(store, row), labels.optimum, cost, mse)
