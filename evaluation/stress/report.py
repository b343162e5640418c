"""Rows as cells, JSON and Markdown."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from evaluation.stress import bounds, gl_bounds
from evaluation.stress.findings import Bound, Broken, Finding, NotRun, Row
from schemas.problem import ExitCode, Problem

HEADINGS: Final = ("path", "case", "absolute", "relative", "where", "bound", "verdict")
MEASURED: Final = "measured"
BOUNDS: Final = "bounds"


def violates(row: Row) -> bool:
    """Whether the row is a violation: beyond its bound, or not finished."""
    return isinstance(row, Broken) or (isinstance(row, Finding) and not row.ok)


def cells(row: Row) -> tuple[str, ...]:
    """A row of the table, under `HEADINGS`."""
    if isinstance(row, NotRun):
        return (row.path, "", "", "", row.why, "", "not run")
    if isinstance(row, Broken):
        return (row.path, "", "", "", row.why, "", "FAILED")
    limit = f"{_number(row.bound)} {row.measure}" if row.judged else "none"
    verdict = ("ok" if row.ok else "VIOLATION") if row.judged else "shown"
    return (row.path, row.case, _number(row.absolute), _number(row.relative), row.where, limit, verdict)


def grouped(rows: Iterable[Row]) -> list[Row]:
    """Rows of one path together, paths in the order in which they first came."""
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.path, []).append(row)
    return [row for group in groups.values() for row in group]


def as_json(rows: Sequence[Row], seed: int, quick: bool) -> dict[str, Any]:
    """Everything as one JSON object. Numbers that are not finite, such as the bound of a row not judged, are null."""
    return {
        "seed": seed,
        "quick": quick,
        "violations": sum(map(violates, rows)),
        "rows": [_row(row) for row in rows],
    }


def _row(row: Row) -> dict[str, Any]:
    found = {name: _finite(value) for name, value in asdict(row).items()}
    return {**found, "verdict": cells(row)[-1].lower()}


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _number(value: float) -> str:
    return "0" if value == 0.0 else f"{value:.2g}"


def check_markdown(path: Path) -> None:
    """Refuse a document that `write_markdown` could not write.

    Raises:
        Problem: There is none, it has not the marks, or it cannot be written.
    """
    if not path.is_file() or not os.access(path, os.W_OK):
        raise Problem(
            f"There is no document {path} that can be written.", "Name a Markdown file that has marks for the tables."
        )
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise Problem(f"{path} is not text in UTF-8.", "Name a Markdown file that has marks for the tables.") from error
    for mark in (MEASURED, BOUNDS):
        _between(path, text, mark, "")


def write_markdown(path: Path, rows: Sequence[Row]) -> None:
    """Put the measured rows and the bounds between their marks in a document.

    Args:
        path: A Markdown file with the marks `<!-- measured -->`, `<!-- /measured -->` and the same for `bounds`.
        rows: The rows.

    Raises:
        Problem: The file has not these marks.
    """
    text = path.read_text(encoding="utf-8")
    text = _between(path, text, MEASURED, table(HEADINGS, map(cells, grouped(rows))))
    path.write_text(_between(path, text, BOUNDS, bounds_table()), encoding="utf-8")


def bounds_table() -> str:
    """All bounds as a Markdown table."""
    rows: list[tuple[str, ...]] = []
    for note, listed in (("", bounds.BOUNDS), (" (GL)", gl_bounds.BOUNDS), (" (GL, n 4096)", gl_bounds.DEEP)):
        rows += _bound_rows(note, listed)
    return table(("path", "bound", "of the", "floor", "why"), rows)


def _bound_rows(note: str, listed: Mapping[str, Bound]) -> list[tuple[str, ...]]:
    return [
        (f"{path}{note}", _limit(bound), f"{bound.measure} error", _number(bound.floor), bound.why)
        for path, bound in listed.items()
    ]


def _limit(bound: Bound) -> str:
    return _number(bound.value) if math.isfinite(bound.value) else "none, shown only"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(headings) + " |", "|" + " --- |" * len(headings)]
    return "\n".join([*lines, *("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)])


def _between(path: Path, text: str, mark: str, content: str) -> str:
    start, end = f"<!-- {mark} -->", f"<!-- /{mark} -->"
    before, found, rest = text.partition(start)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise Problem(f"{path} has no place for the table.", f"Add {start} and {end} to it.", ExitCode.USAGE)
    return f"{before}{start}\n{content}\n{end}{after}"
