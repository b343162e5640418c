"""Networks of regrets in which pixels weigh what FLIP makes of their errors (`labeller.flip_weights`), unseen assets.

The errors that are scored are not weighted: weights are in the labels that are trained on alone. Beside its q every row
has the mean FLIP of its pictures, and how many times that of the variant it is compared with this is.
"""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.predicting.cost import network_cost
from benchmarks.predicting.labels import labels_of, oracle_of
from benchmarks.predicting.scoring import Row, allocation_of, score_key, scored_row
from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.training import Trainings
from benchmarks.predicting.variants import Variant, variants
from benchmarks.predicting.views import ViewRow, load_dump
from labeller.curves import composite, error_curves
from labeller.flip_weights import flip_weights
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from labeller.shards import read_shard, write_shard
from renderer.metrics import flip
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.tail import TailName
from trainer.dataset import ViewData, view_data
from trainer.train import train
from trainer.weights import Weights, load_weights, save_weights

UNSEEN_FLIP: Final = 1e-5
"""Mean FLIP that counts as none."""


def weighted_scores(trainings: Trainings, variant: Variant) -> list[Row]:
    """A row for each view, as of `benchmarks.predicting.scoring.scores_of`, with `flip` and `flip / base`."""
    found: list[Row] = []
    for fold in trainings.folds:
        base = score_key(trainings, variants()[variant.base], fold)
        key = key_of(score_key(trainings, variant, fold), base, variant.weights, trainings.store.code("weighted"))
        found += trainings.store.remember("scores", key, partial(_score_fold, trainings, variant, fold))
    return found


def weighted_network(trainings: Trainings, variant: Variant, fold: int) -> Weights:
    """The network that has not seen a fold's assets; trained where it is not there."""
    store = trainings.store
    key = key_of(trainings.key(variant, fold), variant.weights, store.code("weighted"))
    path = store.path("networks", f"{key}.safetensors")
    if not path.exists():
        seen = [row for row in trainings.rows if trainings.sees(row, fold)]
        views = [weighted_view(store, row, variant.tail) for row in seen]
        weights = train([view for view in views if view.rows], (), variant.config).weights
        store.write(path, lambda part: save_weights(part, weights))
    return load_weights(path)


def weighted_view(store: Store, row: ViewRow, tail: TailName) -> ViewData:
    """The training rows of a view whose errors are weighted by FLIP; made where they are not there.

    Args:
        store: Where they are kept.
        row: The view.
        tail: Of the curves.
    """
    key = key_of(row.digest, tail, store.code("labels"), store.code("weighted"))
    shard = store.path("weighted", f"{key}.safetensors")
    if not shard.exists():
        dump = load_dump(store, row)
        usual = error_curves(dump, tail)
        kept = [found.k for found in allocate_curves(dump, usual, row.budgets, "optimal")]
        curves = error_curves(dump, tail, weights=flip_weights(dump, kept, tail))
        write_shard(shard, dump, curves, lower_hulls(curves), row.budgets)
    return view_data(read_shard(shard), row.asset)


def flip_of(dump: FragmentDump, k: NDArray[np.int32], tail: TailName) -> float:
    """Mean FLIP of the picture that an allocation gives, against the exact one.

    Args:
        dump: Fragments of a view.
        k: int32 [P], core fragments.
        tail: What stands for the others.
    """
    shape = dump.height, dump.width, 3
    shown, exact = (display8(composite(dump, kept, tail)).reshape(shape) for kept in (k, dump.counts))
    return flip(shown, exact)[0]


def _score_fold(trainings: Trainings, variant: Variant, fold: int) -> list[Row]:
    networks = weighted_network(trainings, variant, fold), trainings.network(variants()[variant.base], fold)
    unseen = [row for row in trainings.rows if not trainings.sees(row, fold)]
    return [_score_view(trainings.store, row, variant, *networks) for row in unseen]


def _score_view(store: Store, row: ViewRow, variant: Variant, weights: Weights, usual: Weights) -> Row:
    dump, labels = load_dump(store, row), labels_of(store, row, variant.tail)
    curves, cost = labels.curves(dump), network_cost(weights, variant.tail)
    spend, spend_usual = (allocation_of(variant, network, dump, curves) for network in (weights, usual))

    def mse(budget: int) -> float:
        return curves.total(spend(budget)) / (3 * row.pixels)

    own, usual_flip = (
        [flip_of(dump, allocate(budget), variant.tail) for budget in row.budgets] for allocate in (spend, spend_usual)
    )
    return {
        **scored_row(row, oracle_of(store, row), labels.mse["optimal"], cost, mse),
        "flip": own,
        "flip / base": [(f + UNSEEN_FLIP) / (u + UNSEEN_FLIP) for f, u in zip(own, usual_flip, strict=True)],
    }
