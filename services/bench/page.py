"""The benchmark's page: one HTML file with its charts in it, which needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from schemas.bench import BenchResult, BenchView
from services.advice.gathered import of_bench
from services.advice.page import part
from services.bench.account import said_device
from services.bench.bars import error_bars
from services.bench.groups import (
    Group,
    Row,
    group,
    groups_of,
    measured,
    offline,
    said_budget,
    said_technique,
)
from services.report import charts
from services.report.page import environment
from services.summary import UNFIT, said_unfit
from services.summary import Row as ChartRow


@dataclass(frozen=True, slots=True)
class Drawn:
    """Charts of a group.

    Attributes:
        svgs: Time against error, memory against error.
        legend: Marks of their techniques, HTML.
    """

    svgs: tuple[str, ...]
    legend: str

    @property
    def any(self) -> bool:
        """Whether there is something to see."""
        return any(self.svgs)


def page(result: BenchResult, plots: Sequence[str], mixed: str | None) -> str:
    """HTML.

    Args:
        result: All that was measured.
        plots: Names of the files with plots.
        mixed: What to say if the results are of different sources.
    """
    groups = groups_of(result.views)
    factors = sorted({cell.budget_factor for view in result.views for cell in view.cells if cell.budget_factor})
    figures = [(factor, svg) for factor in factors if (svg := error_bars(groups, factor))]
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
            advice=[(each.title, part(of_bench(each.title, each.views))) for each in groups],
            plots=plots,
            charts=charts_of,
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


def charts_of(shown: Group) -> Drawn:
    """Time against error, and memory against error, at equal fragments."""
    rows = [_chart_row(row) for row in (*measured(shown.rows, "none"), *measured(shown.rows, "fragments"))]
    svgs = [charts.error_chart(rows, shown.title, cost) for cost in (charts.TIME, charts.MEMORY)]
    # Points without a budget have their names beside them.
    numbered = [row.technique for row in rows if row.budget_factor]
    return Drawn(tuple(svg for svg in svgs if svg), charts.legend(numbered))


def said_machines(views: Sequence[BenchView]) -> list[str]:
    """Machines, drivers and clocks of views in words, each with the commits that it measured."""
    commits: dict[str, dict[str, None]] = {}
    for view in views:
        machine = ", ".join(f"{name} {value}" if name == "cores" else value for name, value in view.machine.items())
        commits.setdefault(f"{machine}; {view.driver}; {view.clock}", {})[view.commit or "unknown"] = None
    return [f"{where}; commit{'s'[: len(of) > 1]} {', '.join(of)}" for where, of in commits.items()]


def _by_budget(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    return [(budget, list(found)) for budget, found in groupby(rows, lambda row: said_budget(row.key))]


def _chart_row(row: Row) -> ChartRow:
    return ChartRow(
        technique=said_technique(row.key),
        budget_factor=row.key.budget_factor or 0.0,
        mse=row.mse,
        psnr=row.psnr,
        flip=row.flip,
        ms=row.ms,
        pool_bytes=row.pool_bytes,
        total_bytes=row.total_bytes,
        views=row.views,
        exact_views=row.exact_views,
        over_baseline=None,
    )
