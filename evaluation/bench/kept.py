"""Results on disk: one JSON line for each view and run, so that what was measured is not measured again."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from pydantic import ValidationError

from evaluation.writing import replacing
from schemas.bench import BenchView, CellKey
from schemas.problem import ExitCode, Problem

ROWS = "views.jsonl"


class Kept:
    """The lines of an output folder.

    Args:
        folder: Made if it is missing.
        resume: Whether lines of earlier runs are kept.

    Raises:
        Problem: The folder cannot be written, or a line in it is none of these.
    """

    def __init__(self, folder: Path, resume: bool) -> None:
        self._path = folder / ROWS
        self._asked: set[str] = set()
        self.views: list[BenchView] = []
        try:
            folder.mkdir(parents=True, exist_ok=True)
            text = self._path.read_text(encoding="utf-8") if resume and self._path.exists() else ""
        except OSError as error:
            raise Problem(
                f"{folder} cannot be written: {error.strerror or error}.", "Name another folder with --out."
            ) from error
        # What a kill cut off is measured again.
        whole = text[: text.rfind("\n") + 1]
        self.views = [_parsed(self._path, line) for line in whole.splitlines()]
        if not resume or whole != text:
            with replacing(self._path) as path:
                path.write_text(whole, encoding="utf-8")

    def add(self, view: BenchView) -> None:
        """Append a line; it is on the disk when this returns."""
        with self._path.open("a", encoding="utf-8") as file:
            file.write(_line(view))
            file.flush()
            os.fsync(file.fileno())
        self.views.append(view)

    def missing(self, key: str, planned: Iterable[CellKey]) -> list[CellKey]:
        """The cells of a view that no line has; it is one of those that this run asks for."""
        self._asked.add(key)
        done = {cell.key for view in self.views if view.key == key for cell in view.cells}
        return [cell for cell in planned if cell not in done]

    def merged(self) -> tuple[BenchView, ...]:
        """Views in the order in which they were begun; the cells of all lines of a view together, later ones win.

        Of a view that was measured with several settings (repeats, camera path, an edited scene, ...), only those that
        this run asks for are given, else the latest: a mean over settings would say nothing.
        """
        found: dict[str, BenchView] = {}
        for view in self.views:
            before = found.get(view.key)
            found[view.key] = view if before is None else _together(before, view)
        chosen: dict[tuple[object, ...], BenchView] = {}
        for view in found.values():
            place = (view.scene, view.alpha, view.width, view.height, view.view)
            before = chosen.get(place)
            if before is None or view.key in self._asked or before.key not in self._asked:
                chosen[place] = view
        return tuple(chosen.values())


def _together(before: BenchView, after: BenchView) -> BenchView:
    cells = {cell.key: cell for cell in (*before.cells, *after.cells)}
    marks = {
        (mark.rule, mark.tail, mark.g, mark.budget_factor): mark for mark in (*before.yardsticks, *after.yardsticks)
    }
    update = {
        "cells": tuple(cells.values()),
        "yardsticks": tuple(marks.values()),
        "seconds": before.seconds + after.seconds,
    }
    return after.model_copy(update=update)


def _line(view: BenchView) -> str:
    return view.model_dump_json(exclude_defaults=True) + "\n"


def _parsed(path: Path, line: str) -> BenchView:
    try:
        return BenchView.model_validate_json(line)
    except ValidationError as error:
        raise Problem(
            f"{path} has a line that is no result of this version.",
            "Give --fresh to measure all anew, or another --out.",
            ExitCode.CONFLICT,
        ) from error
