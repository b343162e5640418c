"""`diaphane stress`: the table, JSON, exit statuses, and that a broken fast path makes it fail."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diaphane.cli.app import run
from evaluation.stress import cases, curves, fills
from evaluation.stress.suites import Listed
from labeller.curves import Curves
from schemas.problem import ExitCode


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """One small list instead of all."""
    one = cases.Case("n 5", cases.dump_of([cases.some_list(np.random.default_rng(0), 5)]))
    monkeypatch.setattr(curves, "curve_cases", lambda quick, seed: [one])


@pytest.mark.usefixtures("few")
def test_a_table_with_verdicts_and_status_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["stress", "--quick", "--only", "reference", "--only", "transmittance.rejected"]) == ExitCode.OK
    out, err = capsys.readouterr()
    lines = out.splitlines()
    assert lines[0].split() == ["path", "case", "absolute", "relative", "where", "bound", "verdict"]
    assert {line.split()[0] for line in lines[1:-1]} == {"reference", "transmittance.rejected"}
    assert lines[1].split()[-1] == "ok"
    assert lines[2].split()[-1] == "shown"
    assert lines[-1].endswith("0 violations, seed 0")
    assert "curves: " in err


@pytest.mark.usefixtures("few")
def test_a_broken_kernel_is_a_violation_with_status_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    right = curves.error_curves

    def broken(*args: Any, **options: Any) -> Curves:
        found = right(*args, **options)
        return replace(found, error=found.error * np.float32(1.000001))

    monkeypatch.setattr(curves, "error_curves", broken)
    assert run(["stress", "--quick", "--only", "curves", "--search", "0", "--json"]) == ExitCode.CHECK_FAILED
    out, _ = capsys.readouterr()
    told = json.loads(out)
    wrong = {row["path"] for row in told["rows"] if row["verdict"] == "violation"}
    assert wrong == {"curves", "curves.weights", "curves.by_g"}
    assert told["violations"] == len([row for row in told["rows"] if row["verdict"] == "violation"])


def test_a_fill_that_ignores_its_weights_is_a_violation(monkeypatch: pytest.MonkeyPatch) -> None:
    right = fills.budget_fill
    monkeypatch.setattr(fills, "budget_fill", lambda weights, *rest: right(np.ones(len(weights)), *rest))
    assert run(["stress", "--quick", "--only", "fill.budget"]) == ExitCode.CHECK_FAILED


def test_ranks_of_other_prices_are_a_violation(monkeypatch: pytest.MonkeyPatch) -> None:
    right = fills.ranks_of
    monkeypatch.setattr(fills, "ranks_of", lambda prices, counts: right(prices[::-1], counts))
    assert run(["stress", "--quick", "--only", "fill.cuts"]) == ExitCode.CHECK_FAILED


def test_an_exception_is_a_row_and_status_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def load(self: Listed) -> Any:
        raise MemoryError("no room")

    monkeypatch.setattr(Listed, "load", load)
    assert run(["stress", "--quick", "--only", "csr"]) == ExitCode.CHECK_FAILED
    assert "MemoryError: no room" in capsys.readouterr().out


def test_a_missing_library_is_said_and_status_0(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def load(self: Listed) -> Any:
        raise ModuleNotFoundError("No module named 'numba'", name="numba")

    monkeypatch.setattr(Listed, "load", load)
    assert run(["stress", "--quick", "--only", "csr", "--json"]) == ExitCode.OK
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert row == {"path": "curves", "why": "numba not installed", "verdict": "not run"}


def test_an_unknown_path_is_a_usage_error() -> None:
    assert run(["stress", "--only", "nonsense"]) == ExitCode.USAGE


@pytest.mark.usefixtures("few")
def test_the_seed_decides_everything(capsys: pytest.CaptureFixture[str]) -> None:
    told = []
    for seed in ("3", "3", "4"):
        run(["stress", "--quick", "--only", "csr", "--only", "fill.budget", "--json", "--seed", seed])
        told.append(json.loads(capsys.readouterr().out))
    assert told[0] == told[1] != told[2]


@pytest.mark.usefixtures("few")
def test_markdown_is_written(tmp_path: Path) -> None:
    document = tmp_path / "STRESS.md"
    document.write_text("<!-- measured -->\n<!-- /measured -->\n<!-- bounds -->\n<!-- /bounds -->\n")
    assert run(["stress", "--quick", "--only", "csr", "--markdown", str(document)]) == ExitCode.OK
    assert "| csr | random, N 20000 | 0 | 0 | nowhere | 0 absolute | ok |" in document.read_text()
    assert run(["stress", "--quick", "--only", "csr", "--markdown", str(tmp_path / "none.md")]) != ExitCode.OK


@pytest.mark.parametrize("content", [None, b"no marks", b"\xff\xfe"])
def test_a_document_that_cannot_be_written_is_refused_before_anything_is_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes | None
) -> None:
    monkeypatch.setattr(Listed, "load", lambda self: pytest.fail("a suite was run"))
    document = tmp_path / "STRESS.md"
    document.mkdir() if content is None else document.write_bytes(content)
    assert run(["stress", "--quick", "--only", "csr", "--markdown", str(document)]) == ExitCode.USAGE
