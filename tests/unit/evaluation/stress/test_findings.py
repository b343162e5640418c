"""Rows: which error is judged, what counts as worst, and how they are shown."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from evaluation.stress import report
from evaluation.stress.findings import INFORMATION, Broken, Finding, Measure, NotRun, compared, worst_of
from schemas.problem import Problem


def row(absolute: float, relative: float = 0.0, bound: float = 1.0, measure: Measure = "absolute") -> Finding:
    return Finding("curves", "some", absolute, relative, "pixel 3", bound, measure)


@pytest.mark.parametrize(
    ("finding", "ok"),
    [
        (row(1.0), True),
        (row(1.1), False),
        (row(9.0, 0.5, measure="relative"), True),
        (row(0.0, 1.5, measure="relative"), False),
        (row(math.nan), False),
        (row(math.inf), False),
        (row(math.inf, bound=INFORMATION), True),
    ],
)
def test_the_measured_error_decides(finding: Finding, ok: bool) -> None:
    assert finding.ok == ok
    assert report.violates(finding) != ok


def test_the_worst_entry_is_found_and_named() -> None:
    truth = np.array([[1.0, 100.0], [1e-12, 2.0]])
    found = truth + np.array([[0.0, 1.0], [0.001, 0.5]])
    absolute = compared("p", "c", found, truth, 1.0)
    assert (absolute.absolute, absolute.relative, absolute.where) == (1.0, 0.25, "row 0, 1")
    relative = compared("p", "c", found, truth, 1.0, "relative", 1e-3, lambda index: f"at {index}")
    assert (relative.relative, relative.where) == (1.0, "at (1, 0)")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_infinitely_wrong(value: float) -> None:
    found = compared("p", "c", [1.0, value], [1.0, 1.0], 1e9)
    assert found.absolute == math.inf
    assert found.where == "row 1"
    assert not found.ok
    if math.isinf(value):
        assert compared("p", "c", [value], [value], 0.0).ok


def test_no_entries_are_no_error_and_other_shapes_are_refused() -> None:
    assert compared("p", "c", [], [], 0.0).ok
    with pytest.raises(ValueError, match="shape"):
        compared("p", "c", [1.0], [1.0, 2.0], 0.0)


def test_the_worst_of_several_rows_says_where_it_comes_from() -> None:
    good, bad = row(0.5), Finding("curves", "hard", 3.0, 0.1, "k 7", 1.0, "absolute")
    worst = worst_of([good, bad], "2 inputs")
    assert (worst.case, worst.absolute, worst.where, worst.ok) == ("2 inputs", 3.0, "hard: k 7", False)
    assert not worst_of([good, row(math.nan)], "2 inputs").ok


ROWS = [row(0.25), row(2.0), row(math.inf, bound=INFORMATION), NotRun("gl", "no driver"), Broken("fills", "OSError: |")]


def test_every_row_has_a_verdict() -> None:
    assert [report.cells(x)[-1] for x in ROWS] == ["ok", "VIOLATION", "shown", "not run", "FAILED"]
    assert sum(map(report.violates, ROWS)) == 2


def test_json_holds_no_number_that_json_has_not() -> None:
    told = json.loads(json.dumps(report.as_json(ROWS, 3, True), allow_nan=False))
    assert (told["seed"], told["quick"], told["violations"]) == (3, True, 2)
    assert [x["verdict"] for x in told["rows"]] == ["ok", "violation", "shown", "not run", "failed"]
    assert told["rows"][0]["absolute"] == 0.25
    assert told["rows"][2]["bound"] is None


def test_paths_are_grouped_in_the_order_of_their_first_rows() -> None:
    one, other = row(0.0), Finding("csr", "some", 0.0, 0.0, "", 0.0, "absolute")
    assert report.grouped([one, other, one]) == [one, one, other]


def test_tables_go_between_their_marks_and_nowhere_else(tmp_path: Path) -> None:
    document = tmp_path / "STRESS.md"
    document.write_text("a\n<!-- measured -->\nyesterday\n<!-- /measured -->\nb\n<!-- bounds --><!-- /bounds -->\nc\n")
    report.write_markdown(document, ROWS)
    report.write_markdown(document, ROWS)  # again: nothing is added
    text = document.read_text()
    assert text.startswith("a\n<!-- measured -->\n| path |")
    assert "yesterday" not in text
    assert "OSError: \\|" in text
    assert text.count(report.bounds_table()) == 1
    assert text.endswith("<!-- /bounds -->\nc\n")
    document.write_text("no marks")
    with pytest.raises(Problem, match="no place"):
        report.write_markdown(document, ROWS)
