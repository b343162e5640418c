"""The networks' and the refusals' part of `diaphane stress`, quick; and that a wrong form is seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evaluation.stress import predictors, refusals, search
from evaluation.stress.bounds import BOUNDS
from evaluation.stress.findings import Finding, NotRun, Options, Row
from evaluation.stress.predictors import NEEDED, Rows, form, networks, predicted64, real_features
from labeller.curves import composite
from trainer.weights import Weights

QUICK = Options(quick=True)


@pytest.fixture(scope="module")
def network() -> tuple[Weights, Rows]:
    real = real_features(np.random.default_rng(0), 200)
    return next(iter(networks(0, real).values())), real


@pytest.fixture(scope="module")
def rows() -> list[Row]:
    return list(predictors.run(QUICK))


def test_every_form_is_within_its_bound(rows: list[Row]) -> None:
    assert [row for row in rows if not (isinstance(row, Finding) and row.ok)] == []
    assert {row.path for row in rows} == {*NEEDED, "predict.ranks", "features.float16"}
    assert all(row.bound == BOUNDS[row.path].value for row in rows if isinstance(row, Finding))


def test_float16_is_shown_and_not_judged(rows: list[Row]) -> None:
    shown = [row for row in rows if isinstance(row, Finding) and row.path == "features.float16"]
    assert not any(row.judged for row in shown)
    assert max(row.absolute for row in shown) > 1e-3


def test_a_form_with_another_weight_is_a_violation(network: tuple[Weights, Rows], tmp_path: Path) -> None:
    weights, real = network
    other = networks(0, real)["32-16"]
    other.layers[1][0][3, 5] += np.float32(1e-3)
    for path in NEEDED:
        predict = form(path, other, tmp_path)
        assert not isinstance(predict, NotRun)
        judged = predictors.within(path, "", predict(real), predicted64(weights, real), [""] * len(real))
        assert not judged.ok, path


@pytest.mark.parametrize("library", ["torch", "onnxruntime"])
def test_a_form_without_its_library_is_not_run(
    network: tuple[Weights, Rows], library: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(predictors, "find_spec", lambda name: None if name == library else object())
    missing = {path for path in NEEDED if isinstance(form(path, network[0], tmp_path), NotRun)}
    assert missing == {"predict.torch" if library == "torch" else "predict.onnx"}


@pytest.fixture(scope="module")
def refused() -> dict[str, Finding]:
    return {row.case: row for row in refusals.run(QUICK) if isinstance(row, Finding)}


def test_every_entry_point_refuses_what_is_not_finite(refused: dict[str, Finding]) -> None:
    assert [row for row in refused.values() if not row.ok] == []
    assert len(refused) == 10


def test_an_entry_point_that_takes_nan_is_a_violation() -> None:
    accepted = refusals._refusal("some", lambda: composite)
    unclear = refusals._refusal("some", lambda: int("?"))
    crashed = refusals._refusal("some", lambda: {}["?"])
    assert [row.ok for row in (accepted, unclear, crashed)] == [False, False, False]
    assert accepted.where == "accepted"


def test_a_search_reports_one_row_for_curves_and_each_form() -> None:
    found = list(search.run(Options(search=0.2)))
    assert [(row.path, getattr(row, "ok", None)) for row in found] == [
        ("curves.search", True),
        *[("predict.search", True)] * len(NEEDED),
    ]
    assert list(search.run(Options(search=0.0))) == []
