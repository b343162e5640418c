"""Aligned columns and short numbers for the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from evaluation.visible import visible


def plain(text: Any) -> str:
    """Text of somebody else on one line, without what a terminal would take for commands."""
    return "".join(" " if sign.isspace() else sign for sign in visible(str(text))).strip()


def print_columns(headings: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Prints rows under headings, aligned, nothing cut off; None is a dash."""
    cells = [list(headings), *([("–" if value is None else plain(value)) or "–" for value in row] for row in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(headings))]
    for row in cells:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def seconds(value: float | None) -> str:
    """A duration as `42 s`, `3 min`, `2 h 5 min`."""
    if value is None:
        return "–"
    if value < 90.0:
        return f"{value:.0f} s"
    minutes = round(value / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def size(count: float) -> str:
    """Bytes as `1.2 MiB`."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024.0 or unit == "GiB":
            return f"{count:.0f} B" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1024.0
    raise AssertionError


def percent(fraction: float | None) -> str:
    """A fraction as `42 %`."""
    return "–" if fraction is None else f"{100.0 * fraction:.0f} %"
