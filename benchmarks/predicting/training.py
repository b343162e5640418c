"""Training on all assets but those of a fold, by the product's own code."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from benchmarks.predicting.augmentation import REMAPS, Remap, recoloured
from benchmarks.predicting.distilled import DistilledHead
from benchmarks.predicting.inputs import changed
from benchmarks.predicting.labels import labels_of
from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.variants import Variant, variants
from benchmarks.predicting.views import ViewRow, load_dump
from labeller.shards import read_shard
from renderer.features import derive, gather
from schemas.bundle import ACTIVATIONS, FEATURE_LIMIT
from schemas.tail import DENSITY_BINS
from trainer.dataset import ViewData, view_data
from trainer.paper import with_paper_inputs
from trainer.train import train
from trainer.weights import Weights, load_weights, save_weights

Named = list[tuple[str, ViewData]]
"""Views with their assets."""

_REMAPPED_MODE = "alpha .33"
"""Views of this mode are those that are remapped: in the other one the same fragments come again."""


def folds_of(assets: Sequence[str], folds: int) -> dict[str, int]:
    """Asset -> the fold that holds it out; the same for the same assets, whatever their order."""
    names = sorted(set(assets), key=lambda name: hashlib.md5(name.encode(), usedforsecurity=False).hexdigest())
    return {name: number % min(folds, max(len(names), 1)) for number, name in enumerate(names)}


class Trainings:
    """Networks of variants. Rows of the variant that was trained last stay in memory.

    Args:
        store: Where labels and networks are kept.
        rows: All views.
        folds: How many.
    """

    def __init__(self, store: Store, rows: Sequence[ViewRow], folds: int) -> None:
        self.store, self.rows = store, rows
        self.fold = folds_of([row.asset for row in rows], folds)
        self._kept: tuple[str, Named] = ("", [])

    @property
    def folds(self) -> list[int]:
        """Their numbers."""
        return sorted(set(self.fold.values()))

    def key(self, variant: Variant, fold: int) -> str:
        """Of everything that decides a network."""
        seen = [
            (row.asset, labels_of(self.store, row, variant.taught).key) for row in self.rows if self.sees(row, fold)
        ]
        outputs = {name: list(activation) for name, activation in ACTIVATIONS.items()}
        teacher = self._teacher(variant)
        taught = self.key(teacher, fold) if teacher else None, variant.teaching
        about = (variant.config.decisive, variant.inputs, variant.augmentation, taught, outputs, FEATURE_LIMIT)
        return key_of(*about, seen, self.store.code("training"))

    def sees(self, row: ViewRow, fold: int) -> bool:
        """Whether a view is trained on."""
        return self.fold[row.asset] != fold

    def network(self, variant: Variant, fold: int) -> Weights:
        """The network that has not seen a fold's assets; trained where it is not there."""
        path = self.store.path("networks", f"{self.key(variant, fold)}.safetensors")
        if not path.exists():
            teacher = self._teacher(variant)
            head = DistilledHead(self.network(teacher, fold), variant.teaching) if teacher else None
            views = [view for asset, view in self._views(variant) if self.fold[asset] != fold]
            # Held-out assets have no say in anything, so none are given.
            weights = train(views, (), variant.config, checkpoint=self._checkpoint(path), head=head).weights
            self.store.write(path, lambda part: save_weights(part, weights))
            self._checkpoint(path).unlink(missing_ok=True)
        return load_weights(path)

    @staticmethod
    def _teacher(variant: Variant) -> Variant | None:
        return variants()[variant.teacher] if variant.teacher else None

    @staticmethod
    def _checkpoint(path: Path) -> Path:
        return path.with_suffix(".checkpoint")

    def _views(self, variant: Variant) -> Named:
        """All views as training rows."""
        is_paper = variant.config.preset != "gain-curve"
        key = key_of(variant.taught, variant.inputs, variant.augmentation, is_paper)
        if self._kept[0] != key:
            self._kept = ("", [])  # first of all: two data sets would take twice the memory
            read = [(row.asset, view) for row in self.rows for view in self._of(row, variant, is_paper)]
            self._kept = (key, [(asset, view) for asset, view in read if view.rows])
        return self._kept[1]

    def _of(self, row: ViewRow, variant: Variant, is_paper: bool) -> Iterator[ViewData]:
        """A view, and what is made of it to be trained on as well."""
        own = self._read(row, variant, None, is_paper)
        yield own
        if variant.augmentation == "colours":
            yield replace(own, features=recoloured(own.features, seed=int(row.digest[:8], 16)))
        elif variant.augmentation is not None and row.mode == _REMAPPED_MODE:
            for remap in REMAPS[variant.augmentation]:
                yield self._read(row, variant, remap, is_paper)

    def _read(self, row: ViewRow, variant: Variant, remap: Remap | None, is_paper: bool) -> ViewData:
        shard = read_shard(labels_of(self.store, row, variant.taught, remap).shard)
        view = view_data(shard, row.asset)
        if is_paper:
            scored = [level.budget for level in shard.meta.levels if level.scored and level.log_lambda is not None]
            return with_paper_inputs(view, load_dump(self.store, row), shard.pixel, scored)
        if variant.inputs != "plain":
            dump = load_dump(self.store, row)
            features = derive(gather(dump, DENSITY_BINS.get(variant.taught, 0)))
            return replace(view, features=changed(features, variant.inputs, dump.width)[shard.pixel])
        return view
