"""What labelling leaves out, counted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.curves import curves_of, dump_for
from support.dumps import random_dump

from labeller import shards
from labeller.curves import error_curves
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from labeller.shards import write_shard
from labeller.skips import budget_skips, needed_budgets, pixel_skips
from schemas.skips import COMPLETE_BUDGETS, EXACT_PIXELS, REPEATED_BUDGETS


def test_pixels_that_take_no_part_are_counted() -> None:
    # Empty; one fragment that shows something; one and two that show nothing; to be decided.
    curves = curves_of([[0.0], [0.5, 0.0], [0.0, 0.0], [0.0, 0.0, 0.0], [0.5, 0.2, 0.0]])
    assert pixel_skips(dump_for(curves), lower_hulls(curves)) == {EXACT_PIXELS: 2}


def test_pixels_that_are_skipped_have_no_hull_and_get_nothing() -> None:
    dump = random_dump(30, 20, 6, seed=4)
    curves = error_curves(dump)
    hulls = lower_hulls(curves)
    skips = pixel_skips(dump, hulls)
    decided = np.count_nonzero(np.diff(hulls.offsets))
    assert sum(skips.values()) + decided == np.count_nonzero(dump.counts)
    assert all(skips.values())
    (found,) = allocate_curves(dump, curves, [int(0.4 * dump.total)], "optimal", hulls)
    idle = (dump.counts > 0) & (np.diff(hulls.offsets) == 0)
    assert (dump.counts[idle] == 1).any(), "one fragment is exact in the tail"
    assert (found.k[idle] == 0).all()


@given(st.lists(st.integers(0, 60), max_size=8), st.integers(0, 50))
def test_every_budget_is_needed_once_or_skipped_for_a_reason(budgets: list[int], total: int) -> None:
    needed, skips = needed_budgets(budgets, total), budget_skips(budgets, total)
    assert len(budgets) == len(needed) + sum(skips.values())
    assert skips[COMPLETE_BUDGETS] == sum(budget >= total for budget in budgets)
    assert list(needed) == sorted(set(needed))
    assert set(needed) == {budget for budget in budgets if budget < total}
    assert (skips[REPEATED_BUDGETS] > 0) == (len([b for b in budgets if b < total]) > len(needed))


def test_a_shard_computes_no_budget_twice_and_none_that_holds_everything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    def allocate(dump: object, curves: object, budgets: list[int], *rest: object) -> list[object]:
        asked.extend(budgets)
        return []

    monkeypatch.setattr(shards, "allocate_curves", allocate)
    dump = random_dump(12, 9, 6, seed=1)
    curves = error_curves(dump)
    half, everything = dump.total // 2, dump.total
    write_shard(tmp_path / "view", dump, curves, lower_hulls(curves), [half, half, everything, 2 * everything])
    assert asked.count(half) == 1
    assert len(set(asked)) == len(asked)
    assert max(asked) < everything
