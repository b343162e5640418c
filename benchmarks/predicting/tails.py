"""Tails that were tried: the certified optimum under each, and fragments in proportion to n, which needs no network."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.predicting.labels import labels_of, oracle_of
from benchmarks.predicting.store import Store, key_of
from benchmarks.predicting.tail_kernels import (
    bin_exponents,
    errors_with,
    exponents_with,
    moment_exponents,
    power_exponents,
)
from benchmarks.predicting.views import ViewRow, load_dump
from labeller.allocation import RuleName
from labeller.curves import Curves, error_curves_by_g
from labeller.rules import allocate_curves
from renderer.frame import front_bytes
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_BINS, DENSITY_G, ROOT_SHARE, TailName
from trainer.dataset import LOSSLESS_MSE

GS: Final = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5)
"""Constants of the density tail that a third output could choose from."""

SHIPPED: Final[tuple[TailName, ...]] = ("weighted-average", "exact-coverage", "density", "density-8", "density-16")

Errors = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Trial:
    """A tail that was tried.

    Attributes:
        name: Of the row.
        pixel_bytes: What it keeps of a pixel while fragments are captured, beside its sum of weighted colours.
        errors: From a dump to float32 [N+P].
    """

    name: str
    pixel_bytes: float
    errors: Callable[[FragmentDump], Errors]


def trials() -> list[Trial]:
    """All of them; those of the product are not among them."""
    made = [
        Trial("density, best g a pixel", 5.0, _best_g),
        Trial("power: D and its mean depth", 8.0, partial(_errors, power_exponents)),
        Trial("four power moments", 20.0, partial(_errors, moment_exponents)),
    ]
    for bins in (4, 8, 16):
        for name, root in (("", ROOT_SHARE), (" equal", 0.0)):
            for kind, levels, bits in (("float", 0, 32), ("8-bit", 255, 8), ("4-bit", 15, 4)):
                if root or kind != "8-bit":
                    pixel_bytes = 4.0 + (bins - 1 if bits == 32 else bins) * bits / 8.0
                    constants = (bins, root, levels)
                    trial = partial(_errors, bin_exponents, constants=constants)
                    made.append(Trial(f"{bins}{name} bins, {kind} shares", pixel_bytes, trial))
    return made


def scored(store: Store, rows: Sequence[ViewRow]) -> list[dict[str, Any]]:
    """Every tail on every view.

    Returns:
        For each tail its name, bytes a pixel, and for each view its asset, multiples, and q of `optimal` and
        `proportional`.
    """
    found: list[dict[str, Any]] = []
    for tail in SHIPPED:
        views = [_view(store, row, labels_of(store, row, tail).mse) for row in rows]
        found.append({"name": tail, "bytes": _kept_bytes(tail), "views": views})
    for trial in trials():
        views = []
        for row in rows:
            key = key_of(trial.name, row.digest, store.code("tails"))
            views.append(_view(store, row, store.remember("tails", key, partial(_mse, store, row, trial))))
        found.append({"name": trial.name, "bytes": trial.pixel_bytes, "views": views})
    return found


def _kept_bytes(tail: TailName) -> float:
    return float(front_bytes(DENSITY_BINS[tail])) if tail in DENSITY_BINS else 4.0 * (tail == "density")


def _view(store: Store, row: ViewRow, mse: dict[str, list[float]]) -> dict[str, Any]:
    oracle = oracle_of(store, row)
    return {
        "asset": row.asset,
        "multiples": row.multiples,
        **{
            rule: [(e + LOSSLESS_MSE) / (o + LOSSLESS_MSE) for e, o in zip(mse[rule], oracle, strict=True)]
            for rule in ("optimal", "proportional")
        },
    }


def _mse(store: Store, row: ViewRow, trial: Trial) -> dict[str, list[float]]:
    dump = load_dump(store, row)
    # The name says what the weights are to the rules, which do not read it.
    curves = Curves(dump.offsets + np.arange(dump.pixels + 1), trial.errors(dump), "density", DENSITY_G, "display")
    rules: tuple[RuleName, ...] = ("optimal", "proportional")
    return {
        rule: [made.error / (3 * dump.pixels) for made in allocate_curves(dump, curves, row.budgets, rule)]
        for rule in rules
    }


def _errors(kernel: object, dump: FragmentDump, constants: tuple[float, ...] = ()) -> Errors:
    return errors_with(dump, exponents_with(dump, kernel, *constants))


def _best_g(dump: FragmentDump) -> Errors:
    """The lower envelope of the curves of all g: whatever k a pixel gets, it has the g that is best for it."""
    by_g = error_curves_by_g(dump, GS)
    return np.asarray(np.minimum.reduce([curves.error for curves in by_g]), dtype=np.float32)
