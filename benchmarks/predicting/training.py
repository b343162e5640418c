"""Training on all assets but those of a fold, by the product's own code."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from benchmarks.predicting.labels import labels_of
from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.variants import Variant
from benchmarks.predicting.views import ViewRow
from labeller.shards import read_shard
from schemas.bundle import ACTIVATIONS, FEATURE_LIMIT
from schemas.tail import TailName
from trainer.dataset import ViewData, view_data
from trainer.train import train
from trainer.weights import Weights, load_weights, save_weights

Named = list[tuple[str, ViewData]]
"""Views with their assets."""


def folds_of(assets: Sequence[str], folds: int) -> dict[str, int]:
    """Asset -> the fold that holds it out; the same for the same assets, whatever their order."""
    names = sorted(set(assets), key=lambda name: hashlib.md5(name.encode(), usedforsecurity=False).hexdigest())
    return {name: number % min(folds, max(len(names), 1)) for number, name in enumerate(names)}


class Trainings:
    """Networks of variants. Rows of the tail that was trained for last stay in memory.

    Args:
        store: Where labels and networks are kept.
        rows: All views.
        folds: How many.
    """

    def __init__(self, store: Store, rows: Sequence[ViewRow], folds: int) -> None:
        self.store, self.rows = store, rows
        self.fold = folds_of([row.asset for row in rows], folds)
        self._kept: tuple[TailName | None, Named] = (None, [])

    @property
    def folds(self) -> list[int]:
        """Their numbers."""
        return sorted(set(self.fold.values()))

    def key(self, variant: Variant, fold: int) -> str:
        """Of everything that decides a network."""
        seen = [(row.asset, labels_of(self.store, row, variant.tail).key) for row in self.rows if self.sees(row, fold)]
        outputs = {name: list(activation) for name, activation in ACTIVATIONS.items()}
        return key_of(variant.config.decisive, outputs, FEATURE_LIMIT, seen, self.store.code("training"))

    def sees(self, row: ViewRow, fold: int) -> bool:
        """Whether a view is trained on."""
        return self.fold[row.asset] != fold

    def unseen(self, fold: int) -> list[ViewRow]:
        """The views that a fold's networks are scored on."""
        return [row for row in self.rows if row.is_scored and not self.sees(row, fold)]

    def network(self, variant: Variant, fold: int) -> Weights:
        """The network that has not seen a fold's assets; trained where it is not there."""
        path = self.store.path("networks", f"{self.key(variant, fold)}.safetensors")
        if not path.exists():
            views = [view for asset, view in self._views(variant.tail) if self.fold[asset] != fold]
            # Held-out assets have no say in anything, so none are given.
            weights = train(views, (), variant.config, checkpoint=self._checkpoint(path)).weights
            self.store.write(path, lambda part: save_weights(part, weights))
            self._checkpoint(path).unlink(missing_ok=True)
        return load_weights(path)

    @staticmethod
    def _checkpoint(path: Path) -> Path:
        return path.with_suffix(".checkpoint")

    def _views(self, tail: TailName) -> Named:
        """All views as training rows."""
        if self._kept[0] != tail:
            self._kept = (None, [])  # first of all: two data sets would take twice the memory
            read = [(row.asset, self._read(row, tail)) for row in self.rows]
            self._kept = (tail, [(asset, view) for asset, view in read if view.rows])
        return self._kept[1]

    def _read(self, row: ViewRow, tail: TailName) -> ViewData:
        return view_data(read_shard(labels_of(self.store, row, tail).shard), row.asset)
