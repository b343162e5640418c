"""What presets, early stopping and replay are worth: `python -m benchmarks.training STATE NAME [--out FILE]`.

STATE is the folder of a local build and NAME its data set; trained on its training scenes, scored on its held-out
ones: squared error of the allocation over the optimum's, geometric mean over views and budgets. docs/TRAINING.md has
the tables.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import provenance
from benchmarks.dataset_views import stored_views
from benchmarks.markdown import table
from benchmarks.outputs import add_outputs, write_figures
from renderer.allocation.fill import budget_fill, paper_fill
from trainer.config import TrainConfig
from trainer.dataset import GROUP, Drawing, ViewData
from trainer.evaluate import BudgetScore, evaluate, geometric_mean, score_allocation
from trainer.heads import HEADS
from trainer.paper import paper_batch
from trainer.train import train
from trainer.weights import Weights

SCORED_ROWS = 20_000
Row = dict[str, Any]
Counts = NDArray[np.int32]


def presets(views: Sequence[ViewData], judges: Sequence[ViewData]) -> list[Row]:
    """Each preset, and two rules that need no training."""
    rows = [
        _scored("uniform weights, budget fill", _by_rule(judges, _uniform)),
        _scored("n as weights, budget fill", _by_rule(judges, _proportional)),
        _scored("uniform weights, Eq. 3", _by_rule(judges, _eq3)),
    ]
    for preset in HEADS:
        for steps in sorted({1, TrainConfig.of(preset).steps}):
            began = time.perf_counter()
            config = TrainConfig.of(preset, steps=steps, validate_every=min(steps, 1000))
            result = train(views, (), config)
            row = _scored(f"{preset}, {steps} steps", HEADS[preset].scores(result.weights, judges))
            rows.append({**row, "seconds": round(time.perf_counter() - began, 1), **_says(result.weights, judges)})
    return rows


def stopping(views: Sequence[ViewData], judges: Sequence[ViewData]) -> list[Row]:
    """All training assets to the end, against some kept out to stop by."""
    rows = []
    for title, changes in {
        "1500 steps, no stopping": {},
        "3000 steps, no stopping": {"steps": 3000},
        "3000 steps, patience 3": {"steps": 3000, "validate_every": 250, "patience": 3},
        "1500 steps, patience 3": {"validate_every": 250, "patience": 3},
    }.items():
        result = train(views, (), TrainConfig.of("bin-gains", **changes))
        row = _scored(title, evaluate(result.weights, judges))
        rows.append({**row, "last step": result.history[-1].step, "kept out": ", ".join(result.kept_out)})
    return rows


def forgetting(views: Sequence[ViewData], judges: Sequence[ViewData]) -> list[Row]:
    """Half of the assets first, then the other half, with and without replay; scored on both halves and unseen ones."""
    names = sorted({view.asset for view in views})
    old, new = ([view for view in views if view.asset in half] for half in (names[0::2], names[1::2]))
    config = TrainConfig()
    tuning = config.model_copy(update={"lr": 0.25 * config.lr})
    first = train(old, (), config).weights
    results: dict[str, Weights] = {
        "before": first,
        "fine-tuned on new scenes alone": train(new, (), tuning, start=first).weights,
        "fine-tuned, old scenes replayed": train(new, (), tuning, start=first, replay=old).weights,
        "all scenes from scratch": train(views, (), config).weights,
    }
    parts = {"old scenes": old, "new scenes": new, "held out": judges}
    return [
        {"": title, **{name: round(_score(weights, part), 3) for name, part in parts.items()}}
        for title, weights in results.items()
    ]


def _score(weights: Weights, views: Sequence[ViewData]) -> float:
    return geometric_mean(evaluate(weights, [view.subset(SCORED_ROWS, 0) for view in views]))


def _scored(title: str, scores: Sequence[BudgetScore]) -> Row:
    return {
        "": title,
        "error / optimum": round(geometric_mean(scores), 2),
        "worst": round(max(s.ratio for s in scores), 1),
    }


def _by_rule(judges: Sequence[ViewData], rule: Callable[[Counts, int], Counts]) -> list[BudgetScore]:
    return [
        score_allocation(view, float(price), partial(rule, view.n.astype(np.int32)))
        for view in judges
        for price in view.anchors
    ]


def _uniform(n: Counts, budget: int) -> Counts:
    return budget_fill(np.ones(len(n)), n, budget)


def _proportional(n: Counts, budget: int) -> Counts:
    return budget_fill(n.astype(np.float64), n, budget)


def _eq3(n: Counts, budget: int) -> Counts:
    return np.clip(paper_fill(np.ones(len(n)), budget), 1, n).astype(np.int32)


def _says(weights: Weights, judges: Sequence[ViewData]) -> Row:
    """How an importance varies, and with what its label does, over rows of unseen assets."""
    if weights.head != "importance":
        return {}
    inputs, counts, budgets, _ = paper_batch(judges, (0, 0), 200 * GROUP, Drawing())
    importance, label = weights.answer(inputs)[:, 0].astype(np.float64), counts / budgets[:, 0]
    return {
        "output": float(f"{importance.mean():.3g}"),
        "its spread": float(f"{importance.std():.3g}"),
        "label": float(f"{label.mean():.3g}"),
        "correlation": round(float(np.corrcoef(importance, label)[0, 1]), 3),
    }


PARTS = {"presets": presets, "stopping": stopping, "forgetting": forgetting}


def main() -> None:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("state", type=Path)
    parser.add_argument("name")
    parser.add_argument("--only", choices=PARTS, action="append", help="one of the tables; repeatable")
    add_outputs(parser, has_page=False)
    given = parser.parse_args()
    views, held_out = stored_views(given.state, given.name)
    judges = [view.subset(SCORED_ROWS, 0) for view in held_out]
    found = provenance.head("benchmarks.training")
    with provenance.load_around(found):
        for part in given.only or PARTS:
            found[part] = PARTS[part](views, judges)
            _show(part, found[part])
    write_figures(given.out, found)


def _show(title: str, rows: Sequence[Row]) -> None:
    columns = list(dict.fromkeys(column for row in rows for column in row))
    print(f"\n{title}\n\n{table(columns, ([row.get(column, '') for column in columns] for row in rows))}", flush=True)


if __name__ == "__main__":
    main()
