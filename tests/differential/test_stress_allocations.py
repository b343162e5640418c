"""The allocations' part of `diaphane stress`, quick; and that each of its checks can fail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from evaluation.stress import allocations
from evaluation.stress.bounds import BOUNDS
from evaluation.stress.findings import Options
from evaluation.stress.twins import exact_hull
from labeller.allocation import Allocation
from labeller.hull import Hulls

QUICK = Options(quick=True)


def test_every_path_is_within_its_bound() -> None:
    found = list(allocations.run(QUICK))
    assert [row for row in found if not row.ok] == []
    assert {row.path for row in found} == {
        *("hull", "hull.slopes", "selection", "greedy", "increment", "limits", "bands"),
        *("optimal.greedy", "optimal.bound", "optimal.rising"),
    }
    assert all(row.bound == BOUNDS[row.path].value for row in found)


def test_the_exact_hull_is_the_lowest_convex_curve() -> None:
    error = np.array([9.0, 8.0, 2.0, 1.5, 0.0, 0.0], np.float32)
    assert [float(x) for x in exact_hull(error)] == [9.0, 5.5, 2.0, 1.0, 0.0]


def violated(monkeypatch: pytest.MonkeyPatch, name: str, broken: Callable[..., Any]) -> set[str]:
    """Paths with violations among those of one view, where a function of the suite's module is another one."""
    monkeypatch.setattr(allocations, name, broken)
    rng = np.random.default_rng(1)
    found = [*allocations._bounds(QUICK), *allocations._rising(QUICK)]
    for case, curves in allocations.handmade(rng, quick=True)[2:3]:
        found += allocations._allocated(case, allocations._dump_for(curves), curves)
    return {row.path for row in found if not row.ok}


def test_one_fragment_too_many_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    allocate = allocations.allocate_curves

    def greedy(*args: Any, **options: Any) -> list[Allocation]:
        found = allocate(*args, **options)
        for allocation in found:
            allocation.k[np.argmax(allocation.k)] += 1
        return found

    assert {"greedy", "increment", "limits"} <= violated(monkeypatch, "allocate_curves", greedy)


def test_an_optimum_that_is_none_and_a_bound_that_is_too_high_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    allocate = allocations.allocate_curves

    def worse(*args: Any, **options: Any) -> list[Allocation]:
        found = allocate(*args, **options)
        if found[0].rule != "optimal":
            return found
        return [replace(x, error=1.01 * x.error + 1e-6 * i, bound=1.001 * x.error) for i, x in enumerate(found)]

    expected = {"optimal.greedy", "optimal.bound", "optimal.rising"}
    assert expected <= violated(monkeypatch, "allocate_curves", worse)


def test_hulls_that_are_not_the_lowest_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    lower = allocations.lower_hulls

    class Shuffled(Hulls):
        def steps(self) -> tuple[Any, Any]:
            slopes, lengths = super().steps()
            return slopes[::-1].copy(), lengths

    def high(*args: Any) -> Hulls:
        hulls = lower(*args)
        return Shuffled(hulls.offsets, hulls.k, hulls.error * np.float32(1.001))

    assert violated(monkeypatch, "lower_hulls", high) == {"hull", "hull.slopes"}


def test_other_thresholds_are_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    histogram = allocations.Histogram

    class Late(histogram):  # type: ignore[misc, valid-type]
        def thresholds(self, targets: Any, *args: Any) -> Any:
            return super().thresholds([target + 1 for target in targets], *args)

    monkeypatch.setattr(allocations, "Histogram", Late)
    assert not any(row.ok for row in allocations._selections(np.random.default_rng(0)) if row.case == "random keys")


def test_a_proof_without_a_search_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("labeller.optimal._margin", lambda _state: np.inf)
    wrong = [row for row in allocations._bounds(QUICK) if not row.ok]
    assert [row.path for row in wrong] == ["optimal.bound"]
    assert wrong[0].case.startswith("what fits the rest is far from the price")
