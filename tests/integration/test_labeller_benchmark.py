"""The labeller's benchmark: every part runs, heaps agree bit for bit, and a false certificate is found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import moderngl
import numpy as np
import pytest
from support.dumps import random_dump

from benchmarks import labeller
from benchmarks.labelling.certified import MOST_GAP, Verdict, certify, dual, judge
from benchmarks.labelling.heap import compiled_heap, python_heap
from benchmarks.labelling.linear import row_bands
from benchmarks.labelling.timing import selected
from labeller.allocation import Allocation
from labeller.curves import Curves, error_curves
from labeller.reference import heap_removal
from labeller.rules import allocate_curves
from renderer.samples import write_samples
from schemas.fragments import FragmentDump

DUMP = random_dump(40, 30, 12, seed=4)
VIEW = {"eye": [0.0, 1.2, 4.0], "target": [0.0, 0.5, 0.0], "up": [0.0, 1.0, 0.0], "fov": 45.0}


@pytest.fixture(scope="module")
def curves() -> Curves:
    return error_curves(DUMP)


def _three(dump: FragmentDump, curves: Curves, budget: int) -> list[Allocation]:
    return [allocate_curves(dump, curves, [budget], rule)[0] for rule in ("optimal", "greedy", "increment")]


@pytest.mark.parametrize("least", [0, 1])
@pytest.mark.parametrize("coarse", [False, True], ids=["errors as they are", "many ties"])
def test_the_heaps_agree_bit_for_bit(curves: Curves, least: int, coarse: bool) -> None:
    if coarse:
        curves = replace(curves, error=np.round(curves.error, 2))
    occupied = int(np.count_nonzero(DUMP.counts))
    covering = [int(share * DUMP.total) for share in (0.9, 0.6, 0.4, 0.25)] + [occupied]
    budgets = covering if least else [occupied - 1, occupied // 2, 1, 0]
    lists = [curves.error[first:last] for first, last in zip(curves.offsets, curves.offsets[1:], strict=False)]
    literal = [heap_removal(lists, budget) for budget in budgets]
    for heap in (python_heap, compiled_heap, selected):
        assert np.array_equal(heap(curves, budgets, least), literal), heap.__name__


def test_no_pixel_has_anything_to_remove() -> None:
    single = error_curves(random_dump(9, 5, 1, seed=1))
    for heap in (python_heap, compiled_heap):
        assert np.array_equal(heap(single, [3], 1)[0], single.counts)


def test_true_certificates_pass() -> None:
    verdicts = list(certify(DUMP))
    assert len(verdicts) == 7
    assert not [verdict.wrong for verdict in verdicts if verdict.wrong]


def test_the_dual_is_below_every_allocation_at_any_price(curves: Curves) -> None:
    budget = DUMP.total // 3
    errors = [allocation.error for allocation in _three(DUMP, curves, budget)]
    for lam in (0.0, 1e-9, 1e-5, 1e-3, 0.1):
        assert dual(curves, lam, budget) <= min(errors)


def _judged(curves: Curves, **changes: object) -> Verdict:
    optimal, greedy, increment = _three(DUMP, curves, DUMP.total // 3)
    return judge(DUMP, curves, "a third of N", replace(optimal, **changes), greedy, increment)  # type: ignore[arg-type]


def test_a_false_bound_is_found(curves: Curves) -> None:
    error = _three(DUMP, curves, DUMP.total // 3)[0].error
    assert "is claimed" in _judged(curves, bound=0.5 * error, proven=False, lam=0.0).wrong[0]
    assert "is claimed" in _judged(curves, bound=None).wrong[0]
    assert "is claimed" in _judged(curves, bound=1.01 * error, proven=True).wrong[0]


def test_a_worse_allocation_is_found(curves: Curves) -> None:
    worse = allocate_curves(DUMP, curves, [DUMP.total // 3], "uniform")[0]
    verdict = _judged(curves, k=worse.k, used=worse.used, error=worse.error, proven=False)
    assert verdict.gap > MOST_GAP
    assert any("a gap of" in line for line in verdict.wrong)
    assert any("greedy has" in line for line in verdict.wrong)


def test_an_allocation_that_is_none_is_found(curves: Curves) -> None:
    optimal = _three(DUMP, curves, DUMP.total // 3)[0]
    assert "uses" in _judged(curves, used=optimal.used - 1).wrong[0]
    assert "leaves 0..n" in "".join(_judged(curves, k=optimal.k + 1).wrong)
    assert "says error" in "".join(_judged(curves, error=0.99 * optimal.error).wrong)


def test_row_bands_put_together_are_the_view() -> None:
    bands = list(row_bands(DUMP, 4))
    assert sum(band.height for band in bands) == DUMP.height
    for name in ("rgba", "depth", "background", "facing"):
        assert np.array_equal(np.concatenate([getattr(band, name) for band in bands]), getattr(DUMP, name))
    assert np.array_equal(np.concatenate([band.counts for band in bands]), DUMP.counts)
    assert all(band.offsets[0] == 0 for band in bands)


def test_every_part_runs(gl: moderngl.Context, tmp_path: Path) -> None:
    out, page = tmp_path / "labeller.json", tmp_path / "LABELLER.md"
    command = ["--quick", "--out", str(out), "--page", str(page), "--only"]
    assert labeller.main([*command, "speed", "heaps", "g", "metrics"]) == 0
    assert labeller.main([*command, "linear"]) == 0
    found = json.loads(out.read_text())
    assert set(found) == {"speed", "heaps", "g", "metrics", "linear"}
    assert all(part["quick"] for part in found.values())
    assert found["heaps"]["found"][0]["equal"] == {"compiled heap": True, "Python heap": True}
    assert {cost["banded"] for cost in found["linear"]["found"]["costs"]} == {False, True}
    assert all(gap <= MOST_GAP for cost in found["linear"]["found"]["costs"] for gap in cost["gaps"])
    text = page.read_text()
    for title in ("Speed", "heaps", "Growth with N", "Several g", "Tails and metrics", "only shows that it works"):
        assert title in text
    for plot in ("labeller-time.svg", "labeller-memory.svg"):
        assert f"results/{plot}" in text
        assert ElementTree.parse(tmp_path / plot).getroot().tag.endswith("svg")


def test_scenes_are_certified_and_a_stopped_run_goes_on(gl: moderngl.Context, tmp_path: Path) -> None:
    (scene, *_) = [path for path in write_samples(tmp_path / "bottles") if path.stem == "bottles"]
    listed = {"name": "bottles", "main": f"bottles/{scene.name}", "variant_selection": None, "triangles": 0}
    (tmp_path / "MANIFEST.json").write_text(json.dumps({"scenes": [{**listed, "views": [VIEW]}]}))
    rows, out = tmp_path / "rows.jsonl", tmp_path / "labeller.json"
    command = ["--quick", "--only", "certified", "--scenes", str(tmp_path), "--rows", str(rows), "--out", str(out)]
    assert labeller.main(command) == 0
    first = json.loads(out.read_text())["certified"]["found"]
    assert first["scenes"]["bottles"]["views"] == 2
    assert first["scenes"]["bottles"]["decided"] > 0
    before = rows.read_text()
    assert labeller.main(command) == 0
    assert rows.read_text() == before
    assert json.loads(out.read_text())["certified"]["found"] == first

    lines = [json.loads(line) for line in before.splitlines()]
    lines[0]["verdicts"][0]["wrong"] = ["a gap of 1"]
    rows.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert labeller.main(command) == 1
