"""Rows of scores to the figures of a table: geometric means over views, per asset, and the worst."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from benchmarks.casting.cases import MODES
from benchmarks.predicting.cost import Cost, network_cost
from benchmarks.predicting.labels import OPTIMUM, RIVALS, labels_of, oracle_of
from benchmarks.predicting.scoring import Row, facts_of, ratio, scores_of
from benchmarks.predicting.store import Store
from benchmarks.predicting.training import Trainings
from benchmarks.predicting.variants import Variant
from benchmarks.predicting.views import MULTIPLES, ViewRow
from schemas.tail import BINNED_TAILS

Means = dict[str, list[float | None]]
"""Mode -> a value for each of `MULTIPLES`; None where no view has that budget."""


def geometric_mean(values: Iterable[float]) -> float | None:
    """Of positive numbers; None of none."""
    logs = np.log(list(values))
    return float(np.exp(logs.mean())) if len(logs) else None


def by_multiple(rows: Sequence[Row], what: str) -> list[float | None]:
    """Geometric mean over views at each of `MULTIPLES`; None where no view has that budget.

    Args:
        rows: Each with its `multiples`, and values in the same order.
        what: Which values.
    """
    found: dict[float, list[float]] = {multiple: [] for multiple in MULTIPLES}
    for row in rows:
        for multiple, value in zip(row["multiples"], row[what], strict=True):
            found[multiple].append(value)
    return [geometric_mean(values) for values in found.values()]


def by_mode(rows: Sequence[Row], what: str) -> Means:
    """The same for the views of each mode."""
    return {mode: by_multiple([row for row in rows if row["mode"] == mode], what) for mode in MODES}


def score(q: Mapping[str, Sequence[float | None]]) -> float:
    """One number for a row: the geometric mean of the modes and budgets that there are."""
    return geometric_mean(value for values in q.values() for value in values if value is not None) or float("nan")


def variant_summary(trainings: Trainings, variant: Variant) -> dict[str, Any]:
    """Scores and cost of a variant; it is trained and scored where that has not been done."""
    rows = scores_of(trainings, variant)
    assets = sorted({row["asset"] for row in rows})
    worse = [found for row in rows for found in row["worse"]]
    return {
        "size": variant.size,
        "tail": variant.tail,
        # Folds differ in none of it.
        "cost": asdict(network_cost(trainings.network(variant, trainings.folds[0]), variant.tail)),
        "q": by_mode(rows, "q"),
        "of optimum": by_mode(rows, "of optimum"),
        "worse": sum(worse),
        "cells": len(worse),
        "worst": _worst(rows),
        "assets": {asset: by_multiple([row for row in rows if row["asset"] == asset], "q") for asset in assets},
    }


def rules_summary(store: Store, rows: Sequence[ViewRow]) -> list[dict[str, Any]]:
    """The optimum and rules without a network, with every tail."""
    found = []
    scored = [row for row in rows if row.is_scored]
    for tail in BINNED_TAILS:
        for rule in (OPTIMUM, *RIVALS):
            judged = [
                {**facts_of(row), "q": list(map(ratio, labels_of(store, row, tail).mse[rule], oracle_of(store, row)))}
                for row in scored
            ]
            found.append({"tail": tail, "rule": rule, "q": by_mode(judged, "q"), "worst": _worst(judged)})
    return found


def front(points: Mapping[str, Sequence[float]]) -> list[str]:
    """Names of the points that no other one equals or betters in everything, and betters in something.

    Args:
        points: Name -> numbers, less is better.
    """

    def is_beaten(point: Sequence[float]) -> bool:
        return any(
            all(o <= p for o, p in zip(other, point, strict=True)) and tuple(other) != tuple(point)
            for other in points.values()
        )

    return [name for name, point in points.items() if not is_beaten(point)]


def cost_of(row: Mapping[str, Any]) -> Cost:
    """The cost in a row of figures."""
    return Cost(**row["cost"])


def _worst(rows: Sequence[Row]) -> dict[str, Any]:
    """The view and budget with the largest q."""
    cases = [
        {"q": q, "multiple": multiple, **{name: row[name] for name in ("asset", "mode", "view")}}
        for row in rows
        for multiple, q in zip(row["multiples"], row["q"], strict=True)
    ]
    return max(cases, key=lambda case: case["q"])
