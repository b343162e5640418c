"""Where the command line writes: results on stdout, everything else on stderr; one JSON object each with --json."""

from __future__ import annotations

import json
import logging
import os
import sys
import tempfile
import traceback
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.logging import RichHandler

from diaphane.cli.lines import plain
from schemas.problem import ExitCode, Problem


def out() -> Console:
    """Console for results."""
    return Console(file=sys.stdout, highlight=False, soft_wrap=True)


def err() -> Console:
    """Console for progress and errors."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


def print_json(value: Any) -> None:
    """One JSON object on stdout."""
    json.dump(value, sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")


def tell_new_folder(folder: Path) -> None:
    """Says on stderr that a folder, which a result goes into, does not exist yet."""
    if not folder.exists():
        err().print(f"note: the folder {plain(folder)} does not exist; it will be made.", markup=False)


def set_up_logging() -> None:
    """Warnings of the packages go to stderr, one line each."""
    handler = RichHandler(console=err(), show_time=False, show_path=False)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[handler], force=True)


def show_problem(problem: Problem, *, as_json: bool) -> int:
    """Prints what is wrong and what to do about it; returns the exit status."""
    if as_json:
        detail = {
            "title": problem.title,
            "remedy": problem.remedy,
            "code": int(problem.code),
            "name": problem.code.name.lower(),
        }
        print(json.dumps(detail), file=sys.stderr)
    else:
        console = err()
        console.print("[bold red]error:[/] ", end="")
        console.print(plain(problem.title), markup=False)  # with names and numbers out of other people's files
        console.print(plain(problem.remedy), markup=False)
    return int(problem.code)


def unexpected(error: Exception, folder: Path) -> Problem:
    """Writes the traceback to a file and makes the error one that names it.

    Args:
        error: What was raised.
        folder: Where the file goes; the system's temporary folder if that cannot be written.
    """
    text = "".join(traceback.format_exception(error))
    name = f"error-{datetime.now(UTC):%Y%m%dT%H%M%S}-{os.getpid()}.txt"
    for place in (folder / "errors", Path(tempfile.gettempdir())):
        try:
            place.mkdir(parents=True, exist_ok=True)
            (place / name).write_text(text, encoding="utf-8")
        except OSError:
            continue
        return _unexpected(error, f"The details are in {place / name}; please report them.")
    return _unexpected(error, "The details could not be written anywhere: is the disk full?")


def _unexpected(error: Exception, remedy: str) -> Problem:
    summary = (str(error).splitlines() or [""])[0][:200]
    return Problem(f"Something unexpected happened ({type(error).__name__}: {summary}).", remedy, ExitCode.CHECK_FAILED)
