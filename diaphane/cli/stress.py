"""`diaphane stress`: every fast path against float64, on inputs made to break it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from diaphane.cli import output
from diaphane.cli.lines import plain, print_columns
from diaphane.cli.state import JsonOption
from schemas.problem import ExitCode


def stress(
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="PATH", help="Run only this fast path, such as predict; repeatable."),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Use fewer and smaller inputs.")] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")] = 0,
    search: Annotated[
        float, typer.Option("--search", min=0.0, help="Seconds of each search for a worst case; 0 for none.")
    ] = 3.0,
    markdown: Annotated[
        Path | None,
        typer.Option("--markdown", metavar="FILE", help="Also write the tables between their marks in this document."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Run every fast path against float64 on extreme inputs; exit status 1 if one is further off than it may be."""
    from evaluation.stress import report
    from evaluation.stress.findings import Options, Row
    from evaluation.stress.suites import rows_of, selected

    if markdown is not None:
        report.check_markdown(markdown)  # minutes before there is anything to write
    options = Options(quick=quick, seed=seed, search=search)
    wanted = tuple(only or ())
    rows: list[Row] = []
    for suite in selected(wanted):
        begun, before = time.monotonic(), len(rows)
        output.err().print(f"{suite.name} ...", markup=False)
        rows += rows_of(suite, options, wanted)
        bad = sum(map(report.violates, rows[before:]))
        told = f"{suite.name}: {len(rows) - before} rows, {bad} violations, {time.monotonic() - begun:.0f} s"
        output.err().print(told, markup=False)
    rows = report.grouped(rows)
    violations = sum(map(report.violates, rows))
    if as_json:
        output.print_json(report.as_json(rows, seed, quick))
    else:
        print_columns(report.HEADINGS, map(report.cells, rows))
        print(plain(f"{len(rows)} rows, {violations} violations, seed {seed}"))
    if markdown is not None:
        report.write_markdown(markdown, rows)
    if violations:
        raise typer.Exit(int(ExitCode.CHECK_FAILED))
