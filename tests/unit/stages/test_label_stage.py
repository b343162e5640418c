"""Stage `label`: what it answers for every budget, and what it does not compute."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import zarr
from support.dumps import random_dump
from support.processes import BLOCKED, ROOT, missing_from

from labeller.allocation import RULES
from labeller.curves import error_curves
from labeller.flip_weights import flip_weights
from labeller.rules import allocate_curves
from labeller.shards import read_shard
from renderer.dump import write_dump
from schemas.pixel_weights import PixelWeights
from schemas.problem import Problem
from schemas.tail import DEFAULT_TAIL
from stages.allocations import pixel_allocations, read_allocation
from stages.desk import SHARD
from stages.label import LABEL, LabelFacts, LabelParams
from stages.making import label

DUMP = random_dump(20, 15, 9, seed=5)
N = DUMP.total
BUDGETS = (N // 2, 2 * N, N // 4, N // 2, N)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, LabelFacts]:
    return _made(tmp_path_factory)


@pytest.fixture(scope="module")
def folder(made: tuple[Path, LabelFacts]) -> Path:
    return made[0]


def _made(tmp_path_factory: pytest.TempPathFactory, weights: PixelWeights = "none") -> tuple[Path, LabelFacts]:
    rendered, made = tmp_path_factory.mktemp("render"), tmp_path_factory.mktemp("label")
    write_dump(rendered, DUMP)
    params = LabelParams(budgets=BUDGETS, tail=DEFAULT_TAIL, g=0.75, metric="display", seed=3, weights=weights)
    task = LABEL.task("box front", params, inputs=())
    desk = SimpleNamespace(artifact=lambda task, stage: rendered)
    return made, label.make(desk, task, params, made, lambda fraction, note: None)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def facts(made: tuple[Path, LabelFacts]) -> LabelFacts:
    return made[1]


def test_every_budget_has_an_answer_in_the_order_asked(facts: LabelFacts) -> None:
    curves = error_curves(DUMP, DEFAULT_TAIL)
    assert set(facts.errors) == set(RULES)
    for rule in RULES:
        expected = [found.error for found in allocate_curves(DUMP, curves, BUDGETS, rule)]
        assert facts.errors[rule] == pytest.approx(tuple(expected))
    for budget, certificate in zip(BUDGETS, facts.certificates, strict=True):
        assert 0.0 <= certificate.bound <= certificate.error
        assert (certificate.error == 0.0) == (budget >= N)


def test_a_budget_is_allocated_once_and_one_that_holds_everything_never(folder: Path) -> None:
    kept = zarr.open_group(folder / "allocations.zarr", mode="r")
    assert kept.attrs["budgets"] == [N // 4, N // 2]
    for rule in RULES:
        for budget in (N // 2, N // 4):
            (made,) = allocate_curves(DUMP, error_curves(DUMP, DEFAULT_TAIL), [budget], rule)
            assert read_allocation(folder, rule, budget).tolist() == made.k.tolist()
            assert pixel_allocations(folder, budget, 37)[rule] == made.k[37]
    with pytest.raises(Problem, match="has no allocations"):
        read_allocation(folder, "optimal", N)


def test_what_took_no_part_is_counted(facts: LabelFacts, folder: Path) -> None:
    skips = dict(facts.skips)
    exact = skips.pop("pixels exact at k = 0")
    assert skips == {
        "budgets that hold all fragments of a view": 2,
        "budgets given more than once": 1,
    }
    assert exact >= np.count_nonzero(DUMP.counts == 1)
    vertices = np.diff(read_shard(folder / SHARD).hull_offsets)
    assert np.count_nonzero(vertices == 0) == pytest.approx(0.2 * exact, abs=6), "the rows are a fifth of the pixels"


def test_the_shard_is_the_one_that_the_facts_name(facts: LabelFacts, folder: Path) -> None:
    shard = folder / SHARD
    assert facts.shard.bytes == shard.stat().st_size
    assert read_shard(shard).meta.sampling.seed == 3
    assert [level.budget for level in read_shard(shard).meta.levels if level.scored] == [N // 4, N // 2]


def test_the_image_of_the_label_role_has_all_that_every_kind_of_labels_needs() -> None:
    environment = {**os.environ, "PYTHONPATH": f"{BLOCKED}:{ROOT}", "BLOCKED_IMPORTS": ",".join(missing_from("label"))}
    code = "import stages.making.label, sys; print('flip_evaluator' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("False\n", "")


def test_weights_are_in_the_rows_alone(
    facts: LabelFacts, folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    other, about = _made(tmp_path_factory, weights="flip")
    assert about.errors == facts.errors
    assert about.certificates == facts.certificates
    plain, weighted = read_shard(folder / SHARD), read_shard(other / SHARD)
    assert (plain.meta.weights, weighted.meta.weights) == ("none", "flip")
    assert np.array_equal(plain.pixel, weighted.pixel)
    usual = error_curves(DUMP, DEFAULT_TAIL)
    kept = [found.k for found in allocate_curves(DUMP, usual, [N // 4, N // 2], "optimal")]
    counted = flip_weights(DUMP, kept, DEFAULT_TAIL)
    first = weighted.hull_offsets[:-1][np.diff(weighted.hull_offsets) > 0]
    pixel = weighted.pixel[np.diff(weighted.hull_offsets) > 0]
    at_least = usual.at(np.zeros_like(DUMP.counts))[pixel]
    np.testing.assert_allclose(weighted.hull_error[first], counted[pixel] * at_least, rtol=1e-5)
