"""Which cells are planned, what memory buys, and what flicker is."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.scenes import VIEW

from evaluation.bench.cells import Bundle, fragments_within, planned
from evaluation.bench.flicker import STEP, camera_path, error_change
from evaluation.bench.options import BenchOptions
from evaluation.bench.rounds import times_of
from renderer.techniques.chain import SLOT_BYTES
from schemas.bundle import TailSpec

IMAGES = np.random.default_rng(1).integers(0, 256, (4, 12, 16, 3)).astype(np.uint8)


@pytest.fixture
def options(tmp_path: Path) -> BenchOptions:
    return BenchOptions((), ("sbuffer", "kbuffer", "kbuffer-optimal"), tmp_path, budgets=(1.0, 2.0))


def test_only_bounded_techniques_have_budgets_and_tails(options: BenchOptions) -> None:
    cells = planned(replace(options, tails=("density", "paper")), None)
    exact = [cell for cell in cells if cell.technique == "sbuffer"]
    assert [(cell.basis, cell.budget_factor, cell.tail) for cell in exact] == [("none", None, None)]
    optimal = [(c.basis, c.budget_factor, c.tail, c.g) for c in cells if c.technique == "kbuffer-optimal"]
    assert len(optimal) == len(set(optimal)) == 8
    assert ("memory", 2.0, "paper", None) in optimal
    assert ("fragments", 1.0, "density", 0.75) in optimal
    # Its memory is what all are given, but F is not all that it holds: sums that are gathered first may need more.
    assert {cell.basis for cell in cells if cell.technique == "kbuffer"} == {"fragments", "memory"}


def test_without_equal_memory_there_are_only_fragments(options: BenchOptions) -> None:
    assert all(cell.basis != "memory" for cell in planned(replace(options, equal_memory=False), None))


def test_less_than_a_slot_a_pixel_is_no_memory_that_the_fixed_k_buffer_takes(options: BenchOptions) -> None:
    cells = planned(replace(options, budgets=(0.25, 1.0), techniques=("kbuffer",)), None)
    assert [(cell.basis, cell.budget_factor) for cell in cells] == [
        *[("fragments", 0.25), ("fragments", 1.0), ("memory", 1.0)]
    ]


def test_the_learned_technique_has_the_tail_of_its_bundle(options: BenchOptions, tmp_path: Path) -> None:
    bundle = Bundle(tmp_path, "glass@0123", TailSpec(name="binned-8", g=0.5))
    names = "kbuffer-deep", "kbuffer-temporal"
    learned = replace(options, techniques=names, bundle="somewhere", tails=("density", "paper"))
    cells = planned(learned, bundle)
    assert {(cell.tail, cell.g, cell.bundle) for cell in cells} == {("binned-8", None, "glass@0123")}
    assert [cell.technique for cell in cells].count(names[1]) == 4
    assert len(cells) == 8


def test_the_others_have_the_g_of_a_bundle_of_the_same_tail_unless_one_is_asked_for(
    options: BenchOptions, tmp_path: Path
) -> None:
    bundle = Bundle(tmp_path, "glass@0123", TailSpec(name="binned-8", g=0.5))
    for tails, g, expected in [
        (("density",), None, {("density", 0.75)}),
        (("density", "paper"), 2.0, {("density", 2.0), ("paper", None)}),
        ((), None, {("binned-12", None)}),
    ]:
        cells = planned(replace(options, bundle="somewhere", tails=tails, g=g), bundle)  # type: ignore[arg-type]
        assert {(cell.tail, cell.g) for cell in cells if cell.tail is not None} == expected


def test_what_does_not_fit_before_there_is_a_pool_does_not_fit() -> None:
    assert fragments_within(60 * 100, 100, 44, 60) == 200
    assert fragments_within(60 * 100, 100, 44, 61) < 0


@given(st.integers(0, 10**9), st.integers(1, 10**6), st.integers(0, 200))
def test_memory_buys_as_many_fragments_as_fit_and_no_more(total: int, pixels: int, pixel_bytes: int) -> None:
    fragments = fragments_within(total, pixels, pixel_bytes)
    assert fragments * SLOT_BYTES + pixels * pixel_bytes <= total
    assert (fragments + 1) * SLOT_BYTES + pixels * pixel_bytes > total


def test_a_still_error_does_not_flicker_and_a_changing_one_does() -> None:
    exact_before, exact, before, _ = IMAGES // 2 + 10
    assert error_change(exact, exact_before, exact, exact_before) == 0.0
    assert error_change(exact + 9, exact_before + 9, exact, exact_before) == 0.0
    assert error_change(exact + 51, exact_before, exact, exact_before) == pytest.approx(0.2)
    expected = np.abs(
        (exact.astype(float) - before) - (exact.astype(float) - exact_before)  # the new picture is exact
    ).mean()
    assert error_change(exact, before, exact, exact_before) == pytest.approx(expected / 255.0)


def test_the_path_begins_at_the_view_and_turns_about_its_target() -> None:
    path = camera_path(VIEW, 5)
    assert path[0].eye == pytest.approx(VIEW.eye)
    arms = [np.array(view.eye) - view.target for view in path]
    assert [np.linalg.norm(arm) for arm in arms] == pytest.approx([np.linalg.norm(arms[0])] * 5)
    assert [arm[1] for arm in arms] == pytest.approx([arms[0][1]] * 5)
    flat = [arm[[0, 2]] / np.linalg.norm(arm[[0, 2]]) for arm in arms]
    turns = [np.degrees(np.arccos(np.clip(a @ b, -1, 1))) for a, b in pairwise(flat)]
    assert turns == pytest.approx([STEP] * 4, rel=1e-4)
    assert len({view.name for view in path}) == 5


def test_times_are_median_and_range() -> None:
    assert times_of([3.0, 1.0, 10.0]).model_dump() == {"median": 3.0, "least": 1.0, "most": 10.0}
