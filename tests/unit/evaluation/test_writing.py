"""Results on disk are complete or not there."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from evaluation.writing import replacing
from schemas.problem import ExitCode, Problem


def names(folder: Path) -> list[str]:
    return sorted(entry.name for entry in folder.iterdir())


def test_a_file_and_the_folders_above_it_are_made(tmp_path: Path) -> None:
    target = tmp_path / "new" / "folder" / "a.png"
    with replacing(target) as path:
        assert path.name == target.name
        path.write_text("whole")
    assert target.read_text() == "whole"
    assert names(target.parent) == ["a.png"]


def test_a_folder_replaces_the_one_that_was_there(tmp_path: Path) -> None:
    (tmp_path / "a.zarr").mkdir()
    (tmp_path / "a.zarr" / "old").touch()
    with replacing(tmp_path / "a.zarr") as path:
        path.mkdir()
        (path / "new").touch()
    assert names(tmp_path) == ["a.zarr"]
    assert names(tmp_path / "a.zarr") == ["new"]


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_what_was_there_stays_if_anything_goes_wrong(tmp_path: Path, error: BaseException) -> None:
    (tmp_path / "a.png").write_text("old")

    def fail() -> None:
        with replacing(tmp_path / "a.png") as path:
            path.write_text("half")
            raise error

    with pytest.raises((Problem, KeyboardInterrupt)) as caught:
        fail()
    if isinstance(caught.value, Problem):
        assert "No space left" in caught.value.title
        assert caught.value.code == ExitCode.TRY_AGAIN
    assert names(tmp_path) == ["a.png"]
    assert (tmp_path / "a.png").read_text() == "old"


def test_a_file_in_the_way_is_a_problem_that_names_the_result(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(Problem, match=r"a\.png cannot be written"), replacing(tmp_path / "file" / "a.png"):
        pass
