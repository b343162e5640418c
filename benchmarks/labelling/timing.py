"""What is timed by turns: a labelling and its steps, heaps, several g, tails and metrics."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.labelling.child import BUDGETS
from benchmarks.labelling.heap import compiled_heap, python_heap
from benchmarks.labelling.traffic import traffic
from benchmarks.render.setup import in_turns
from labeller.curves import Curves, error_curves, error_curves_by_g
from labeller.greedy import Removals, least_kept, removal_keys
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from schemas.fragments import FragmentDump
from schemas.tail import METRICS, TAILS, MetricName, TailName

GS = (0.75, 0.0, 0.5, 1.0, 0.25, 1.25, 1.5, 2.0)
"""Values of g, of which the first 1, 2, 4 and 8 are asked for."""
Times = dict[str, dict[str, float]]


def budgets_of(dump: FragmentDump) -> list[int]:
    """Five budgets, rising."""
    return [int(share * dump.total) for share in BUDGETS]


def steps(dump: FragmentDump, rounds: int) -> dict[str, Any]:
    """Curves, hulls and the allocations of five budgets: each alone, and all as one.

    Returns:
        `times` in milliseconds of each, `traffic` in bytes of each, `gaps` of the five allocations, and how many hull
        vertices there are.
    """
    budgets = budgets_of(dump)
    curves = error_curves(dump)
    hulls = lower_hulls(curves)

    def whole() -> None:
        allocate_curves(dump, error_curves(dump), budgets, "optimal")

    times = in_turns(
        rounds,
        {
            "curves": lambda: error_curves(dump),
            "hulls": lambda: lower_hulls(curves),
            "five budgets": lambda: allocate_curves(dump, curves, budgets, "optimal", hulls),
            "one budget": lambda: allocate_curves(dump, curves, budgets[1:2], "optimal", hulls),
            "all": whole,
            "curves and greedy": lambda: allocate_curves(dump, error_curves(dump), budgets, "greedy"),
        },
    )
    found = allocate_curves(dump, curves, budgets, "optimal", hulls)
    return {
        "times": times,
        "traffic": traffic(dump, curves, hulls, len(budgets)),
        "vertices": len(hulls.k),
        "gaps": [allocation.gap for allocation in found],
    }


def heaps(dump: FragmentDump, rounds: int) -> dict[str, Any]:
    """Both heaps and `labeller.greedy` on the same curves, five budgets in one descent.

    Args:
        dump: Fragments of a view.
        rounds: How often; plain Python, which has nothing to warm up, runs once between the others' rounds.

    Returns:
        `times` in milliseconds; `equal`: names of the heaps -> whether all k are those of `greedy`.
    """
    budgets = budgets_of(dump)[::-1]
    least = least_kept("greedy", int(np.count_nonzero(dump.counts)), budgets[-1])
    curves = error_curves(dump)
    rules: dict[str, Callable[[Curves, Sequence[int], int], Sequence[NDArray[np.int32]]]] = {
        "greedy": selected,
        "compiled heap": compiled_heap,
        "Python heap": python_heap,
    }
    kept: dict[str, Sequence[NDArray[np.int32]]] = {}

    def call(name: str) -> Callable[[], object]:
        def run() -> None:
            kept[name] = rules[name](curves, budgets, least)

        return run

    fast = {name: call(name) for name in ("greedy", "compiled heap")}
    first = in_turns(rounds, {**fast, "curves": lambda: error_curves(dump)})
    start = time.perf_counter()
    call("Python heap")()
    python = 1e3 * (time.perf_counter() - start)
    second = in_turns(rounds, {**fast, "curves": lambda: error_curves(dump)})
    return {
        "times": {**_together(first, second), "Python heap": {"median": python, "least": python}},
        "equal": {name: all(map(np.array_equal, kept[name], kept["greedy"])) for name in rules if name != "greedy"},
        "removals": dump.total - budgets[-1],
    }


def selected(curves: Curves, budgets: Sequence[int], least: int) -> list[NDArray[np.int32]]:
    """int32 [P] for each budget, what the heaps compute, by `labeller.greedy`."""
    keys = removal_keys(curves, least, "greedy")
    return Removals(lambda: (keys,)).keep(budgets)


def several_g(dump: FragmentDump, rounds: int) -> Times:
    """Curves of one g, and of 1, 2, 4 and 8 at once."""
    at_once = {f"{count} at once": _by_g(dump, count) for count in (1, 2, 4, 8)}
    return in_turns(rounds, {"one": lambda: error_curves(dump), **at_once})


def every_metric(dump: FragmentDump, rounds: int) -> Times:
    """Curves of every tail in every metric, by `tail, metric`."""
    return in_turns(rounds, {f"{tail}, {metric}": _curves(dump, tail, metric) for tail in TAILS for metric in METRICS})


def _by_g(dump: FragmentDump, count: int) -> Callable[[], object]:
    return lambda: error_curves_by_g(dump, GS[:count], "display")


def _curves(dump: FragmentDump, tail: TailName, metric: MetricName) -> Callable[[], object]:
    return lambda: error_curves(dump, tail, metric=metric)


def _together(first: Times, second: Times) -> Times:
    """Of two runs of the same: the mean of their medians, the least of all."""
    return {
        name: {
            "median": 0.5 * (first[name]["median"] + second[name]["median"]),
            "least": min(first[name]["least"], second[name]["least"]),
        }
        for name in first
    }
