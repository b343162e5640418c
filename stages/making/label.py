"""Error curves of a view, its allocations by every rule at every budget, and its training rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from evaluation.wording import counted
from labeller.allocation import RULES, Allocation
from labeller.curves import error_curves, whole_bins
from labeller.flip_weights import flip_weights
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from labeller.shards import write_shard
from labeller.skips import budget_skips, needed_budgets, pixel_skips
from renderer.dump import read_dump
from stages.allocations import write_allocations
from stages.desk import SHARD, Desk
from stages.label import Certified, LabelFacts, LabelParams, Shard
from stages.tasks import Report, Task

Answer = TypeVar("Answer")


def make(desk: Desk, task: Task, params: LabelParams, folder: Path, report: Report) -> LabelFacts:
    """Writes the allocations and the shard."""
    dump = read_dump(desk.artifact(task, "render"))
    curves = error_curves(dump, params.tail, params.g, params.metric)
    hulls = lower_hulls(curves)
    report(0.3, f"curves of {counted(dump.total, 'fragments')}")
    budgets = needed_budgets(params.budgets, dump.total)
    made = {rule: allocate_curves(dump, curves, budgets, rule, hulls=hulls) for rule in RULES}
    write_allocations(folder, made)
    report(0.8, f"{len(RULES)} rules at {len(budgets)} budgets")
    if params.weights == "flip":
        # What is compared with other rules is not weighted; what is learned is.
        weights = flip_weights(dump, [found.k for found in made["optimal"]], params.tail, params.g)
        curves = error_curves(dump, params.tail, params.g, params.metric, weights)
    cuts = whole_bins(dump, curves)
    written = write_shard(
        folder / SHARD, dump, cuts, lower_hulls(cuts), budgets, seed=params.seed, weights=params.weights
    )
    errors = {rule: _answers(params.budgets, allocations, _error, 0.0) for rule, allocations in made.items()}
    return LabelFacts(
        errors={rule: tuple(found) for rule, found in errors.items()},
        certificates=tuple(_answers(params.budgets, made["optimal"], _certificate, _EXACT)),
        shard=Shard(sha256=written.sha256, bytes=written.bytes),
        skips={**pixel_skips(dump, hulls), **budget_skips(params.budgets, dump.total)},
    )


_EXACT = Certified(error=0.0, bound=0.0, gap=0.0)
"""The certificate of a budget that holds all fragments."""


def _answers(
    budgets: Sequence[int], allocations: Sequence[Allocation], answer: Callable[[Allocation], Answer], complete: Answer
) -> list[Answer]:
    """An answer for each budget in the order asked: the allocation's, or that of a budget that holds everything."""
    found = {allocation.budget: answer(allocation) for allocation in allocations}
    return [found.get(budget, complete) for budget in budgets]


def _error(a: Allocation) -> float:
    return a.error


def _certificate(a: Allocation) -> Certified:
    return Certified(error=a.error, bound=a.error if a.bound is None else a.bound, gap=a.gap or 0.0)
