"""Where a benchmark's figures and its page go: the options, and the files."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def add_outputs(parser: argparse.ArgumentParser, required: bool = False, has_page: bool = True) -> None:
    """Adds `--out` and `--page`.

    Args:
        parser: Of the benchmark's options.
        required: Whether `--out` has to be given.
        has_page: Whether there is a page.
    """
    parser.add_argument("--out", type=Path, required=required, metavar="FILE", help="JSON file that the figures go to")
    if has_page:
        parser.add_argument("--page", type=Path, metavar="FILE", help="Markdown file that the tables go to")


def write_figures(path: Path | None, found: Mapping[str, Any], plots: Mapping[str, str] | None = None) -> None:
    """Writes what was measured, where it was asked for.

    Args:
        path: The JSON file; None: nothing is written.
        found: The figures.
        plots: Name -> SVG, for files beside it.
    """
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    for name, svg in (plots or {}).items():
        (path.parent / name).write_text(svg, encoding="utf-8")


def write_page(path: Path | None, text: str) -> None:
    """Writes a page, where one was asked for."""
    if path is not None:
        path.write_text(text, encoding="utf-8")
