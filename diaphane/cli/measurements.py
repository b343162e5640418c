"""`diaphane measurements`: what was measured, of which technique, on which view."""

from __future__ import annotations

from typing import Annotated

import typer

from diaphane.cli import output
from diaphane.cli.lines import print_columns
from diaphane.cli.server import DEFAULT_URL, KeyFileOption, LimitOption, UrlOption, connect
from diaphane.cli.state import JsonOption


def measurements(
    scene: Annotated[str | None, typer.Option("--scene", help="List only those of this scene.")] = None,
    technique: Annotated[str | None, typer.Option("--technique", help="List only those of this technique.")] = None,
    budget: Annotated[float | None, typer.Option("--budget", help="List only those at this budget.")] = None,
    model: Annotated[str | None, typer.Option("--model", help="List only those of this version, NAME@VERSION.")] = None,
    job: Annotated[str | None, typer.Option("--job", help="List only those of this job.")] = None,
    since: Annotated[str | None, typer.Option("--since", help="List only those from this time on, ISO 8601.")] = None,
    until: Annotated[str | None, typer.Option("--until", help="List only those before this time, ISO 8601.")] = None,
    limit: LimitOption = 100,
    url: UrlOption = DEFAULT_URL,
    key_file: KeyFileOption = None,
    as_json: JsonOption = False,
) -> None:
    """Measurements, newest first; MSE is shown times 1e5."""
    from evaluation import summary

    found = list(
        connect(url, key_file).measurements(
            limit,
            scene=scene,
            technique=technique,
            budget=budget,
            model=model,
            job=job,
            since=since,
            until=until,
        )
    )
    if as_json:
        output.print_json({"measurements": found})
        return
    rows = []
    for entry in found:
        m = entry["measurement"]
        scaled = None if m["mse"] is None else 1e5 * m["mse"]
        numbers = [summary.number(value) for value in (m["budget_factor"], scaled, m["psnr"], m["flip"], m["total_ms"])]
        rows.append((m["scene"], m["view"], m["technique"], *numbers, entry["model"]))
    print_columns(("scene", "view", "technique", "F/(WH)", "MSE x1e-5", "PSNR", "FLIP", "ms", "model"), rows)
