"""Running suites: which, and what becomes of one that fails."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import pytest

from evaluation.stress import bounds, suites
from evaluation.stress.findings import Broken, Finding, NotRun, Options, Row
from evaluation.stress.suites import SUITES, Listed, rows_of, selected
from schemas.problem import Problem


def finding(path: str) -> Finding:
    return Finding(path, "some", 0.0, 0.0, "", 0.0, "absolute")


def test_every_path_with_a_bound_belongs_to_a_suite() -> None:
    for path in bounds.BOUNDS:
        assert selected([path]), path


@pytest.mark.parametrize(
    ("only", "names"),
    [
        ((), [suite.name for suite in SUITES]),
        (("fills",), ["fills"]),
        (("fill.budget",), ["fills"]),
        (("csr", "greedy"), ["curves", "allocations"]),
        (("abuffer-list",), ["gl"]),
        (("predict.onnx",), ["predictors"]),
    ],
)
def test_only_what_has_the_path_is_run(only: tuple[str, ...], names: list[str]) -> None:
    assert [suite.name for suite in selected(only)] == names


@pytest.mark.parametrize("name", ["curve", "nothing", ""])
def test_an_unknown_path_is_a_problem_that_lists_the_known_ones(name: str) -> None:
    with pytest.raises(Problem, match=r"abuffer-array.*weighted-blended"):
        selected([name])


def run_of(monkeypatch: pytest.MonkeyPatch, *rows: Row | Exception, only: tuple[str, ...] = ()) -> list[Row]:
    def run(options: Options) -> Iterator[Row]:
        assert options.seed == 5
        for row in rows:
            if isinstance(row, Exception):
                raise row
            yield row

    monkeypatch.setattr(Listed, "load", lambda self: run)
    return list(rows_of(Listed("some", ("a", "b")), Options(seed=5), only))


def test_an_exception_is_a_row_and_what_came_before_it_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = run_of(monkeypatch, finding("a"), RuntimeError("two\nlines"))
    assert rows == [finding("a"), Broken("some", "RuntimeError: two lines")]


def test_a_missing_library_is_not_a_violation_but_a_missing_module_of_ours_is(monkeypatch: pytest.MonkeyPatch) -> None:
    missing = ModuleNotFoundError("No module named 'torch.nn'", name="torch.nn")
    assert run_of(monkeypatch, missing) == [NotRun("some", "torch.nn not installed")]
    ours = ModuleNotFoundError("No module named 'labeller.gone'", name="labeller.gone")
    assert isinstance(run_of(monkeypatch, ours)[0], Broken)


def test_rows_of_other_paths_are_left_out_but_failures_never(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [finding("a"), finding("a.part"), finding("a · llvmpipe"), finding("ab"), finding("b")]
    assert run_of(monkeypatch, *rows, only=("a",)) == rows[:3]
    assert run_of(monkeypatch, *rows, only=("some",)) == rows
    assert isinstance(run_of(monkeypatch, ValueError(), only=("a",))[-1], Broken)


def test_a_missing_driver_is_said_whichever_of_its_paths_was_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, part = NotRun("gl · zink", "no driver"), NotRun("b", "no library")
    assert run_of(monkeypatch, whole, part, only=("a",)) == [whole]


def test_naming_the_suites_imports_none_of_what_they_need() -> None:
    heavy = "{'torch', 'onnx', 'onnxruntime', 'moderngl', 'numba', 'pxr'}"
    code = f"import sys, evaluation.stress.suites; sys.exit(bool({heavy} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_suites_have_distinct_names() -> None:
    names = [suite.name for suite in suites.SUITES]
    assert len(set(names)) == len(names)
