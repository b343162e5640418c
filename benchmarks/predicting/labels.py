"""Labels of a view under a tail: its error curves, its training rows, and what rules without a network do to it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.predicting.augmentation import Remap, remapped
from benchmarks.predicting.cost import Cost, memory_of, rule_cost
from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.views import ViewRow, load_dump
from labeller.allocation import RuleName
from labeller.curves import Curves, error_curves
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from labeller.shards import write_shard
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_G, TailName

ORACLE_TAIL: Final[TailName] = "weighted-average"
ORACLE_RULE: Final[RuleName] = "greedy"
"""DHOIT's optimal k-buffer: Algorithm 1, offline, with its own tail."""

OFFLINE: Final[tuple[RuleName, ...]] = ("optimal", "greedy")
"""Rules that know the error of everything."""

RUN_TIME: Final[tuple[RuleName, ...]] = ("proportional", "importance", "dynamic", "fixed")
"""Rules that a frame can follow."""


@dataclass(frozen=True, slots=True)
class Labelled:
    """A view's labels under a tail.

    Attributes:
        key: Of what decided them.
        tail: The tail.
        mse: Rule -> mean squared error per channel at each of the view's budgets.
        shard: Training rows.
        errors: float32 [N + P] on disk, `labeller.curves.Curves.error`.
    """

    key: str
    tail: TailName
    mse: dict[str, list[float]]
    shard: Path
    errors: Path

    def curves(self, dump: FragmentDump) -> Curves:
        """The error curves; read from disk when they are used."""
        error: NDArray[np.float32] = np.load(self.errors, mmap_mode="r")
        return Curves(dump.offsets + np.arange(dump.pixels + 1), error, self.tail, DENSITY_G, "display")


def labels_of(store: Store, row: ViewRow, tail: TailName, remap: Remap | None = None) -> Labelled:
    """The labels of a view, made where they are not there.

    Args:
        store: Where they are kept.
        row: The view.
        tail: The tail.
        remap: What is changed in it; None: nothing. Such a view is trained on and never scored.
    """
    key = key_of(row.digest, tail, remap, store.code("labels"))
    shard, errors = (store.path("labels", f"{key}.{suffix}") for suffix in ("safetensors", "npy"))
    found = store.remember("labels", key, lambda: _label(store, row, tail, remap, shard, errors))
    return Labelled(key, tail, found["mse"], shard, errors)


def oracle_of(store: Store, row: ViewRow) -> list[float]:
    """Mean squared errors that scores are relative to, one for each of the view's budgets."""
    return labels_of(store, row, ORACLE_TAIL).mse[ORACLE_RULE]


def at_memory(store: Store, row: ViewRow, tail: TailName) -> dict[str, list[float | None]]:
    """Mean squared errors of the rules of a frame at equal total memory, for each of the view's budgets.

    Returns:
        Rule of `RUN_TIME` -> errors; None where it does not fit.
    """
    labels = labels_of(store, row, tail)
    costs = {rule: rule_cost(tail, nearest=rule == "importance") for rule in RUN_TIME}
    key = key_of(labels.key, {rule: asdict(cost) for rule, cost in costs.items()})
    found: dict[str, list[float | None]] = store.remember("memory", key, lambda: _at_memory(store, row, labels, costs))
    return found


def _at_memory(
    store: Store, row: ViewRow, labels: Labelled, costs: dict[RuleName, Cost]
) -> dict[str, list[float | None]]:
    dump = load_dump(store, row)
    curves, found = labels.curves(dump), {}
    for rule, cost in costs.items():
        budgets = [cost.budget(memory_of(m, row.pixels), row.pixels) for m in row.multiples]
        made = iter(_errors(dump, curves, [budget for budget in budgets if budget is not None], rule))
        found[str(rule)] = [None if budget is None else next(made) for budget in budgets]
    return found


def _label(
    store: Store, row: ViewRow, tail: TailName, remap: Remap | None, shard: Path, errors: Path
) -> dict[str, Any]:
    dump = load_dump(store, row)
    if remap is not None:
        dump = remapped(dump, remap)
    curves = error_curves(dump, tail)
    hulls = lower_hulls(curves)
    write_shard(shard, dump, curves, hulls, row.budgets)
    if remap is not None:
        return {"mse": {}}
    store.write(errors, lambda path: np.save(path, curves.error))
    return {"mse": {rule: _errors(dump, curves, row.budgets, rule) for rule in (*OFFLINE, *RUN_TIME)}}


def _errors(dump: FragmentDump, curves: Curves, budgets: list[int], rule: RuleName) -> list[float]:
    return [found.error / (3 * dump.pixels) for found in allocate_curves(dump, curves, budgets, rule)]
