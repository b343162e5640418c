"""Statistics as CSV: columns, passes that only some have, and files that are added to."""

from __future__ import annotations

import csv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest

from evaluation.viewer.comparing import Compared
from evaluation.viewer.statistics import COLUMNS, append, check, row, write
from evaluation.viewer.studio import Shot, Wish
from renderer.techniques import Budget, Rendered
from renderer.timing import Recording
from schemas.problem import Problem
from schemas.view import View

VIEW = View(name="front", eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))


def shot(**passes: float) -> Shot:
    rendered = Rendered(np.zeros((2, 3, 3), np.float32), np.arange(6, dtype=np.int32), {}, 15, 96, 20)
    wish = Wish("kbuffer", VIEW, (3, 2), 2.0, "density-16")
    return Shot(wish, Budget(12, "density-16", 0.75), rendered, Recording(passes=passes))


def compared(psnr: float | None = 30.0, flip: float | None = None) -> Compared:
    return Compared(mse=1e-3, mse_display=9e-4, psnr=psnr, flip=flip, fragments=40, k=(1, 5))


def read(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_a_row_has_every_column_and_its_passes() -> None:
    found = row(3, "left", shot(opaque=1.5, resolve=2.0), compared(flip=0.25), "glass@1.0.0")
    assert tuple(found)[: len(COLUMNS)] == COLUMNS
    expected = {
        "frame": 3, "side": "left", "bundle": "glass@1.0.0", "width": 3, "height": 2, "budget": 12, "fragments": 40,
        "captured": 15, "k_min": 1, "k_max": 5, "pool_bytes": 96, "total_bytes": 96 + 6 * 20, "frame_ms": 3.5,
        "mse": 1e-3, "mse_display": 9e-4, "psnr": 30.0, "flip": 0.25, "ms_opaque": 1.5, "ms_resolve": 2.0,
    }  # fmt: skip
    assert {name: found[name] for name in expected} == expected


def test_numbers_are_written_whole_and_what_is_not_there_is_empty(tmp_path: Path) -> None:
    third = 1.0 / 3.0
    rows = [
        row(0, "left", shot(opaque=third), compared(), ""),
        row(0, "right", shot(opaque=1.0, sort=2.0), compared(psnr=None), ""),
    ]
    write(tmp_path / "s.csv", rows)
    first, second = read(tmp_path / "s.csv")
    assert float(first["ms_opaque"]) == third
    assert (first["ms_sort"], second["ms_sort"]) == ("", "2.0")
    assert (second["psnr"], second["flip"]) == ("", "")


def test_rows_are_added_and_new_passes_become_columns_of_all(tmp_path: Path) -> None:
    path = tmp_path / "new" / "s.csv"
    append(path, [row(0, "left", shot(opaque=1.0), compared(), "")])
    append(path, [row(1, "left", shot(opaque=2.0, sort=3.0), compared(), "")])
    assert [(r["frame"], r["ms_opaque"], r["ms_sort"]) for r in read(path)] == [("0", "1.0", ""), ("1", "2.0", "3.0")]
    assert [r["psnr"] for r in read(path)] == ["30.0", "30.0"]


@pytest.mark.parametrize(
    "content", [b"a,b\n1,2\n", b"", b"\xff\xfe\x00", b"frame,salary\n1,2\n", b"frame,side\n1,2,3\n"]
)
def test_a_file_of_something_else_is_not_touched(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "s.csv"
    path.write_bytes(content)
    with pytest.raises(Problem, match="no file of statistics"):
        append(path, [row(0, "left", shot(), compared(), "")])
    with pytest.raises(Problem, match="no file of statistics"):
        check(path)
    assert path.read_bytes() == content


def test_rows_that_are_added_at_once_are_all_there(tmp_path: Path) -> None:
    path = tmp_path / "s.csv"
    together = Barrier(8)

    def add(number: int) -> None:
        together.wait()
        append(path, [row(number, "left", shot(opaque=1.0), compared(), "")])

    with ThreadPoolExecutor(8) as threads:
        list(threads.map(add, range(8)))
    assert sorted(int(each["frame"]) for each in read(path)) == list(range(8))
