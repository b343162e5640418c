"""Fits and scores of small learned tails (`benchmarks.predicting.learned_tail`), on unseen assets.

The counts are those of the network that the variant is compared with: what changes is the tail alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.predicting.cost import Cost, network_cost
from benchmarks.predicting.labels import labels_of, oracle_of
from benchmarks.predicting.learned_tail import (
    DRAWN,
    STEPS,
    BinnedView,
    Corrections,
    Kind,
    binned_view,
    corrected_errors,
    corrected_exponents,
    fitted,
    pixels_of,
)
from benchmarks.predicting.scoring import Row, allocation_of, score_key, scored_row
from benchmarks.predicting.store import key_of
from benchmarks.predicting.tail_kernels import errors_with
from benchmarks.predicting.training import Trainings
from benchmarks.predicting.variants import Variant, variants
from benchmarks.predicting.views import ViewRow, load_dump
from labeller.rules import allocate_curves
from trainer.weights import Weights


def learned_scores(trainings: Trainings, variant: Variant) -> list[Row]:
    """A row for each view, as of `benchmarks.predicting.scoring.scores_of`.

    The optimum of `exponents` is that of the corrected tail, that of `coverage` the optimum of the tail as it is.
    """
    found: list[Row] = []
    for fold in trainings.folds:
        base = score_key(trainings, _base(variant), fold)
        key = key_of(base, variant.learned, variant.config.seed, trainings.store.code("learned"))
        found += trainings.store.remember("scores", key, partial(_score_fold, trainings, variant, fold))
    return found


def corrections_of(trainings: Trainings, variant: Variant, fold: int) -> Corrections:
    """What was fitted without a fold's assets, to the counts of the network of that fold; made if it is not there."""
    store, base = trainings.store, _base(variant)
    key = key_of(trainings.key(base, fold), variant.learned, variant.config.seed, DRAWN, STEPS, store.code("learned"))
    path = store.path("networks", f"{key}.npz")
    if not path.exists():
        weights, views = trainings.network(base, fold), []
        for number, row in enumerate(row for row in trainings.rows if trainings.sees(row, fold)):
            dump = load_dump(store, row)
            view, curves = binned_view(dump, variant.tail), labels_of(store, row, variant.tail).curves(dump)
            allocate = allocation_of(base, weights, dump, curves)
            drawn = (pixels_of(view, allocate(budget), seed=number) for budget in row.budgets)
            views += [pixels for pixels in drawn if pixels is not None]
        made = fitted(_kind(variant), views, variant.config.seed)
        arrays: dict[str, Any] = {f"w{i}": weight for i, (weight, _) in enumerate(made)}
        arrays |= {f"b{i}": bias for i, (_, bias) in enumerate(made)}
        store.write(path, lambda part: np.savez(part, **arrays))
    return _loaded(path)


def learned_cost(weights: Weights, variant: Variant, corrections: Corrections) -> Cost:
    """That of the counts' network and of the correction, which runs once a pixel, or once a fragment of its tail."""
    cost = network_cost(weights, variant.tail)
    return replace(
        cost,
        weights=cost.weights + sum(weight.size + bias.size for weight, bias in corrections),
        multiply_adds=cost.multiply_adds + sum(weight.size for weight, _ in corrections),
    )


def _score_fold(trainings: Trainings, variant: Variant, fold: int) -> list[Row]:
    weights, corrections = trainings.network(_base(variant), fold), corrections_of(trainings, variant, fold)
    unseen = [row for row in trainings.rows if not trainings.sees(row, fold)]
    return [_score_view(trainings, row, variant, weights, corrections) for row in unseen]


def _score_view(
    trainings: Trainings, row: ViewRow, variant: Variant, weights: Weights, corrections: Corrections
) -> Row:
    store = trainings.store
    dump, labels = load_dump(store, row), labels_of(store, row, variant.tail)
    view, curves, optimum = binned_view(dump, variant.tail), labels.curves(dump), labels.mse["optimal"]
    allocate = allocation_of(_base(variant), weights, dump, curves)
    total: Callable[[NDArray[np.int32]], float]
    if variant.learned == "exponents":
        curves = replace(curves, error=errors_with(dump, corrected_exponents(view, corrections)))
        made = allocate_curves(dump, curves, row.budgets, "optimal")
        optimum, total = [found.error / (3 * row.pixels) for found in made], curves.total
    else:
        total = partial(coverage_total, view, corrections)
    cost = learned_cost(weights, variant, corrections)
    return scored_row(row, oracle_of(store, row), optimum, cost, lambda F: total(allocate(F)) / (3 * row.pixels))


def coverage_total(view: BinnedView, corrections: Corrections, k: NDArray[np.int32]) -> float:
    """Sum of the squared errors of a view whose tails have a corrected coverage.

    Args:
        view: What the bins say of it.
        corrections: The network.
        k: int32 [P], core fragments.
    """
    return float(corrected_errors(view, k, corrections).sum())


def _base(variant: Variant) -> Variant:
    return variants()[variant.base]


def _kind(variant: Variant) -> Kind:
    assert variant.learned in ("exponents", "coverage")
    return variant.learned


def _loaded(path: Path) -> Corrections:
    with np.load(path) as file:
        return tuple((file[f"w{i}"], file[f"b{i}"]) for i in range(2))
