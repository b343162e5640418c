"""Labels of a view under a tail: its curves of whole bins, its training rows, and what other rules do to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.views import ViewRow, load_dump
from labeller.allocation import RuleName
from labeller.curves import Curves, error_curves, whole_bins
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from labeller.shards import write_shard
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_G, TailName

ORACLE_TAIL: Final[TailName] = "weighted-average"
ORACLE_RULE: Final[RuleName] = "greedy"
"""DHOIT's optimal k-buffer: Algorithm 1, offline, with its own tail."""

OPTIMUM: Final = "optimal, whole bins"
"""The certified optimum of what a predictor can choose."""

RIVALS: Final[tuple[RuleName, ...]] = ("importance", "dynamic", "fixed")
"""VKB, the k+-buffer and fixed k: what a frame can follow without a network, any k."""


@dataclass(frozen=True, slots=True)
class Labelled:
    """A view's labels under a tail.

    Attributes:
        key: Of what decided them.
        tail: The tail.
        mse: `OPTIMUM` or rule -> mean squared error per channel at each of the view's budgets.
        shard: Training rows.
        errors: float32 [N + P] on disk, `labeller.curves.Curves.error` of whole bins.
    """

    key: str
    tail: TailName
    mse: dict[str, list[float]]
    shard: Path
    errors: Path

    def curves(self, dump: FragmentDump) -> Curves:
        """The error curves of whole bins; read from disk when they are used."""
        error: NDArray[np.float32] = np.load(self.errors, mmap_mode="r")
        return Curves(dump.offsets + np.arange(dump.pixels + 1), error, self.tail, DENSITY_G, "display")


def labels_of(store: Store, row: ViewRow, tail: TailName) -> Labelled:
    """The labels of a view, made where they are not there.

    Args:
        store: Where they are kept.
        row: The view.
        tail: A tail with bins.
    """
    key = key_of(row.digest, tail, row.multiples, store.code("labels"))
    shard, errors = (store.path("labels", f"{key}.{suffix}") for suffix in ("safetensors", "npy"))
    found = store.remember("labels", key, lambda: _label(store, row, tail, shard, errors))
    return Labelled(key, tail, found["mse"], shard, errors)


def oracle_of(store: Store, row: ViewRow) -> list[float]:
    """Mean squared errors that scores are relative to, one for each of the view's budgets."""
    key = key_of(row.digest, ORACLE_TAIL, row.multiples, store.code("labels"))

    def make() -> list[float]:
        dump = load_dump(store, row)
        return _errors(dump, error_curves(dump, ORACLE_TAIL), row.budgets, ORACLE_RULE)

    found: list[float] = store.remember("oracle", key, make)
    return found


def _label(store: Store, row: ViewRow, tail: TailName, shard: Path, errors: Path) -> dict[str, Any]:
    dump = load_dump(store, row)
    curves = error_curves(dump, tail)
    cuts = whole_bins(dump, curves)
    write_shard(shard, dump, cuts, lower_hulls(cuts), row.budgets)
    if not row.is_scored:
        return {"mse": {}}
    store.write(errors, lambda path: np.save(path, cuts.error))
    rivals = {str(rule): _errors(dump, curves, row.budgets, rule) for rule in RIVALS}
    return {"mse": {OPTIMUM: _errors(dump, cuts, row.budgets, "optimal"), **rivals}}


def _errors(dump: FragmentDump, curves: Curves, budgets: list[int], rule: RuleName) -> list[float]:
    return [found.error / (3 * dump.pixels) for found in allocate_curves(dump, curves, budgets, rule)]
