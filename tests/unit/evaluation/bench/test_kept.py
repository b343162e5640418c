"""What was measured is on the disk, is not measured again, and survives a kill."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.bench import cell, view

from evaluation.bench.kept import ROWS, Kept
from schemas.problem import ExitCode, Problem


def test_cells_that_a_line_has_are_not_missing(tmp_path: Path) -> None:
    first, second = cell("kbuffer"), cell("kbuffer-optimal")
    Kept(tmp_path, resume=True).add(view(first))
    again = Kept(tmp_path, resume=True)
    assert again.missing("a", [first.key, second.key]) == [second.key]
    assert again.missing("another view", [first.key]) == [first.key]
    assert again.views == [view(first)]


def test_lines_of_a_view_are_one_result_and_later_cells_win(tmp_path: Path) -> None:
    kept = Kept(tmp_path, resume=True)
    kept.add(view(cell("kbuffer", mse=1e-3), cell("moment")))
    kept.add(view(cell("kbuffer"), key="b", view="side"))
    kept.add(view(cell("kbuffer", mse=2e-3), cell("adaptive"), seconds=2.0))
    first, second = Kept(tmp_path, resume=True).merged()
    assert [c.technique for c in first.cells] == ["kbuffer", "moment", "adaptive"]
    assert first.cells[0].mse == 2e-3
    assert first.seconds == 3.0
    assert len(first.yardsticks) == 2
    assert second.key == "b"


def test_a_line_that_a_kill_cut_off_is_measured_again(tmp_path: Path) -> None:
    kept = Kept(tmp_path, resume=True)
    kept.add(view(cell("kbuffer")))
    kept.add(view(cell("moment"), key="b"))
    path = tmp_path / ROWS
    path.write_bytes(path.read_bytes()[:-7])
    again = Kept(tmp_path, resume=True)
    assert [v.key for v in again.views] == ["a"]
    again.add(view(cell("moment"), key="b"))
    assert [v.key for v in Kept(tmp_path, resume=True).views] == ["a", "b"]


def test_a_fresh_start_forgets(tmp_path: Path) -> None:
    Kept(tmp_path, resume=True).add(view(cell()))
    assert Kept(tmp_path, resume=False).views == []
    assert Kept(tmp_path, resume=True).views == []


def test_lines_of_something_else_are_a_problem(tmp_path: Path) -> None:
    (tmp_path / ROWS).write_text('{"key": 1}\n')
    with pytest.raises(Problem) as problem:
        Kept(tmp_path, resume=True)
    assert problem.value.code == ExitCode.CONFLICT
    assert "--fresh" in problem.value.remedy


def test_a_folder_that_is_a_file_is_a_problem(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(Problem, match="cannot be written"):
        Kept(tmp_path / "file", resume=True)


def test_a_view_with_other_settings_is_shown_once_as_this_run_asks_for_it(tmp_path: Path) -> None:
    kept = Kept(tmp_path, resume=True)
    kept.add(view(cell("kbuffer", mse=1e-3), key="once"))
    kept.add(view(cell("kbuffer", mse=1e-3), key="elsewhere", view="side"))
    kept.add(view(cell("kbuffer", mse=1e-3), key="thrice"))
    assert [v.key for v in Kept(tmp_path, resume=True).merged()] == ["thrice", "elsewhere"]
    again = Kept(tmp_path, resume=True)
    again.missing("once", [])
    assert [v.key for v in again.merged()] == ["once", "elsewhere"]
