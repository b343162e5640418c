"""The committed tables of docs/STRESS.md are those of the code: its bounds, its paths, and no violation."""

from __future__ import annotations

from pathlib import Path

import pytest

from evaluation.stress import bounds, report
from evaluation.stress.bounds import BOUNDS

DOCUMENT = (Path(__file__).resolve().parents[2] / "docs" / "STRESS.md").read_text(encoding="utf-8")
AGAIN = "run `diaphane stress --markdown docs/STRESS.md`"


def between(mark: str) -> str:
    return DOCUMENT.split(f"<!-- {mark} -->")[1].split(f"<!-- /{mark} -->")[0].strip()


def measured() -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in between("measured").splitlines()[2:]]


def test_the_committed_bounds_are_those_of_the_code() -> None:
    assert between("bounds") == report.bounds_table(), AGAIN


def test_every_path_is_measured_and_none_is_violated() -> None:
    rows = measured()
    assert set(BOUNDS) <= {row[0] for row in rows}, AGAIN
    assert {row[-1] for row in rows} <= {"ok", "shown", "not run"}


@pytest.mark.parametrize("path", sorted(bounds.BOUNDS))
def test_rows_were_judged_by_the_bounds_of_the_code(path: str) -> None:
    bound = BOUNDS[path]
    expected = f"{report._number(bound.value)} {bound.measure}" if bound.value != float("inf") else "none"
    assert {row[5] for row in measured() if row[0] == path} == {expected}, AGAIN


def test_the_document_says_what_search_repeats() -> None:
    from evaluation.stress import search

    assert f"climbs of {search.STEPS} changes" in DOCUMENT
