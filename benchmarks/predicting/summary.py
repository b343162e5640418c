"""Rows of scores to the figures of a table: geometric means over views, per asset, and the worst."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from benchmarks.predicting.cost import Cost, network_cost, rule_cost
from benchmarks.predicting.factor_scores import factor_cost, factor_network, factor_scores
from benchmarks.predicting.inputs import BLOCKS
from benchmarks.predicting.labels import OFFLINE, RUN_TIME, at_memory, labels_of, oracle_of
from benchmarks.predicting.learned_scores import corrections_of, learned_cost, learned_scores
from benchmarks.predicting.scoring import Row, ratio, scores_of
from benchmarks.predicting.store import Store
from benchmarks.predicting.training import Trainings
from benchmarks.predicting.variants import Variant, variants
from benchmarks.predicting.views import MULTIPLES, ViewRow
from benchmarks.predicting.weighted import weighted_network, weighted_scores
from schemas.tail import TailName

TAILS: Final[tuple[TailName, ...]] = ("density-16", "density-8", "density", "weighted-average")
"""Tails that rules are scored with."""


def geometric_mean(values: Iterable[float]) -> float | None:
    """Of positive numbers; None of none."""
    logs = np.log(list(values))
    return float(np.exp(logs.mean())) if len(logs) else None


def by_multiple(rows: Sequence[Row], what: str) -> list[float | None]:
    """Geometric mean over views at F = W H x 1, 2, 4; None where no view has one, or one has no value.

    Args:
        rows: Each with its `multiples`, and values in the same order.
        what: Which values.
    """
    found: dict[int, list[float | None]] = {multiple: [] for multiple in MULTIPLES}
    for row in rows:
        for multiple, value in zip(row["multiples"], row[what], strict=True):
            found[multiple].append(value)
    means: list[float | None] = []
    for values in found.values():
        known = [value for value in values if value is not None]
        means.append(geometric_mean(known) if len(known) == len(values) else None)
    return means


def score(q: Sequence[float | None]) -> float:
    """One number for a row: the geometric mean of those budgets that there are."""
    return geometric_mean(value for value in q if value is not None) or float("nan")


def variant_summary(trainings: Trainings, variant: Variant) -> dict[str, Any]:
    """Scores and cost of a variant; it is trained and scored where that has not been done."""
    rows, cost = _measured(trainings, variant)
    assets = sorted({row["asset"] for row in rows})
    return {
        "part": variant.part,
        "tail": variant.tail,
        "base": variant.base,
        "is_product": not (variant.augmentation or variant.teacher or variant.feedback or variant.labels)
        and (variant.learned, variant.weights) == (None, "none")
        and (variant.inputs, variant.config.preset) == ("plain", "gain-curve"),
        "cost": asdict(cost),
        "q": by_multiple(rows, "q"),
        "of optimum": by_multiple(rows, "of optimum"),
        "at memory": by_multiple(rows, "at memory"),
        "worst": _worst(rows),
        "assets": {asset: by_multiple([row for row in rows if row["asset"] == asset], "q") for asset in assets},
        **({"flip / base": by_multiple(rows, "flip / base")} if "flip / base" in rows[0] else {}),
    }


def _measured(trainings: Trainings, variant: Variant) -> tuple[list[Row], Cost]:
    """Scores of the views, and the cost of one fold's network: folds differ in none of it."""
    first = trainings.folds[0]
    if variant.learned == "factor":
        return factor_scores(trainings, variant), factor_cost(factor_network(trainings, variant, first), variant)
    if variant.learned is not None:
        base, corrections = variants()[variant.base], corrections_of(trainings, variant, first)
        return learned_scores(trainings, variant), learned_cost(trainings.network(base, first), variant, corrections)
    is_plain = variant.weights == "none"
    weights = trainings.network(variant, first) if is_plain else weighted_network(trainings, variant, first)
    cost = network_cost(weights, variant.tail, BLOCKS.get(variant.inputs, 1))
    return (scores_of if is_plain else weighted_scores)(trainings, variant), cost


def rules_summary(store: Store, rows: Sequence[ViewRow]) -> list[dict[str, Any]]:
    """Rules without a network, with every tail."""
    found = []
    for tail in TAILS:
        for rule in (*OFFLINE, *RUN_TIME):
            scored = [_rule_row(store, row, tail, rule) for row in rows]
            cost = rule_cost(tail, nearest=rule == "importance")
            found.append(
                {
                    "tail": tail,
                    "rule": rule,
                    "is_offline": rule in OFFLINE,
                    "cost": asdict(cost),
                    "q": by_multiple(scored, "q"),
                    "at memory": [None] * len(MULTIPLES) if rule in OFFLINE else by_multiple(scored, "at memory"),
                    "worst": _worst(scored),
                }
            )
    return found


def tails_summary(trials: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Figures of `benchmarks.predicting.tails.scored`."""
    return [
        {
            "name": trial["name"],
            "bytes": trial["bytes"],
            "optimal": by_multiple(trial["views"], "optimal"),
            "proportional": by_multiple(trial["views"], "proportional"),
        }
        for trial in trials
    ]


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


def _rule_row(store: Store, row: ViewRow, tail: TailName, rule: str) -> Row:
    oracle, labels = oracle_of(store, row), labels_of(store, row, tail)
    within = [None] * len(oracle) if rule in OFFLINE else at_memory(store, row, tail)[rule]
    return {
        "asset": row.asset,
        "mode": row.mode,
        "view": row.view,
        "multiples": row.multiples,
        "q": [ratio(e, o) for e, o in zip(labels.mse[rule], oracle, strict=True)],
        "at memory": [None if e is None else ratio(e, o) for e, o in zip(within, oracle, strict=True)],
    }


def _worst(rows: Sequence[Row]) -> dict[str, Any]:
    """The view and budget with the largest q."""
    cases = [
        {"q": q, "multiple": multiple, **{name: row[name] for name in ("asset", "mode", "view")}}
        for row in rows
        for multiple, q in zip(row["multiples"], row["q"], strict=True)
    ]
    return max(cases, key=lambda case: case["q"])
