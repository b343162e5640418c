"""The benchmark's page: one HTML file with its charts in it, which needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from evaluation.advice.gathered import of_bench
from evaluation.advice.page import part
from evaluation.bench.account import said_device
from evaluation.bench.album import sheet_of
from evaluation.bench.groups import (
    Row,
    group,
    groups_of,
    offline,
    said_budget,
    said_technique,
)
from evaluation.bench.plots import budget_chart, cost_chart
from evaluation.report.fronts import MEMORY, TIME
from evaluation.report.page import environment
from evaluation.summary import UNFIT, said_unfit
from schemas.bench import BenchResult, BenchView


def page(result: BenchResult, plots: Sequence[str], mixed: str | None, folder: Path | None = None) -> str:
    """HTML.

    Args:
        result: All that was measured.
        plots: Names of the files with plots.
        mixed: What to say if the results are of different sources.
        folder: The output folder, if its pictures shall be shown.
    """
    groups = groups_of(result.views)
    factors = sorted({cell.budget_factor for view in result.views for cell in view.cells if cell.budget_factor})
    figures = [(factor, spec) for factor in factors if (spec := budget_chart(groups, factor))]
    shown = [group("All of them", result.views), *groups] if len(groups) > 1 else groups
    return (
        environment()
        .get_template("bench.html.j2")
        .render(
            result=result,
            views=result.views,
            scenes=list(dict.fromkeys(view.scene for view in result.views)),
            machines=said_machines(result.views),
            mixed=mixed,
            figures=figures,
            groups=shown,
            pictures=lambda of: None if folder is None else sheet_of(folder, of.views),
            advice=[(each.title, part(of_bench(each.title, each.views))) for each in groups],
            plots=plots,
            charts=lambda of: [spec for cost in (TIME, MEMORY) if (spec := cost_chart(of, cost))],
            by_budget=_by_budget,
            offline=offline,
            said=said_technique,
            said_budget=said_budget,
            unfit=UNFIT,
            said_unfit=said_unfit(),
            device=result.device,
            said_device=said_device(result.device),
            timed=lambda rows: any(row.gpu for row in rows),
        )
    )


def said_machines(views: Sequence[BenchView]) -> list[str]:
    """Machines, drivers and clocks of views in words, each with the commits that it measured."""
    commits: dict[str, dict[str, None]] = {}
    for view in views:
        machine = ", ".join(f"{name} {value}" if name == "cores" else value for name, value in view.machine.items())
        commits.setdefault(f"{machine}; {view.driver}; {view.clock}", {})[view.commit or "unknown"] = None
    return [f"{where}; commit{'s'[: len(of) > 1]} {', '.join(of)}" for where, of in commits.items()]


def _by_budget(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    return [(budget, list(found)) for budget, found in groupby(rows, lambda row: said_budget(row.key))]
