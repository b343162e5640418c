"""Puts a report together: text, tables, charts and pictures into one HTML file."""

from __future__ import annotations

import json
import uuid
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from evaluation import summary
from evaluation.looks import title
from evaluation.report.fronts import TIME, error_chart, points_of
from evaluation.report.lines import training_chart
from evaluation.report.pictures import PictureSet, plates
from evaluation.report.vega import Spec, figure, scripts
from evaluation.visible import visible
from schemas.measurement import Measurement, ReportData

TEMPLATES = Path(__file__).resolve().parent.parent / "templates"


@dataclass(frozen=True, slots=True)
class Section:
    """Table and chart over some of the measurements.

    Attributes:
        title: Heading.
        rows: Rows of the table.
        chart: Time against error; None if no times were measured.
        best: (budget, column) -> least value among the techniques that could be shipped: not the oracle.
    """

    title: str
    rows: list[summary.Row]
    chart: Spec | None
    best: dict[tuple[float, str], float]


def write_report(
    path: Path, data: ReportData, pictures: Iterable[PictureSet] = (), advice: Sequence[tuple[str, Markup]] = ()
) -> None:
    """Writes the report of a build, replacing the file in one step.

    Args:
        path: The HTML file; its folder is created if missing.
        data: Everything but the pictures.
        pictures: Sets to show side by side, in order; may be a generator, so that only one is in memory.
        advice: Label of each held-out scene, and what it should be rendered with, as HTML.
    """
    held_out = [scene.label for scene in data.scenes if scene.held_out]
    measured = [m for m in data.measurements if m.scene in held_out]
    trained = [m for m in data.measurements if m.scene not in held_out]
    html = (
        environment()
        .get_template("report.html.j2")
        .render(
            data=data,
            held_out=held_out,
            verdict=summary.sentence(measured),
            overall=_section(f"All held-out scenes ({len(held_out)})", measured),
            by_scene=[_section(label, [m for m in measured if m.scene == label]) for label in held_out],
            trained=_section("Scenes that were trained on", trained) if trained else None,
            training=training_chart(data.training),
            has_charts=True,
            plates=plates(pictures),
            advice=advice,
            not_run=_not_run(data.measurements),
            largest_gap=max((c.gap for c in data.certificates), default=0.0),
            provenance=json.dumps(data.provenance, indent=2, sort_keys=True, default=str),
        )
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    temporary.write_text(html, encoding="utf-8")
    temporary.replace(path)


def _section(heading: str, measurements: Sequence[Measurement]) -> Section:
    rows = summary.rows(measurements)
    best: dict[tuple[float, str], float] = {}
    for row in rows:
        if row.technique == summary.ORACLE:
            continue
        for column in ("mse", "flip", "ms", "total_bytes"):
            value = getattr(row, column)
            if value is not None:
                key = (row.budget_factor, column)
                best[key] = min(value, best.get(key, value))
    return Section(heading, rows, error_chart(points_of(rows, TIME), heading), best)


def _not_run(measurements: Sequence[Measurement]) -> list[tuple[str, int]]:
    reasons = [f"{title(m.technique)}: {m.skipped}" for m in measurements if m.skipped is not None]
    reasons += ["views whose fragments all fit in the budget (exact)" for m in measurements if m.exact]
    return sorted({reason: reasons.count(reason) for reason in reasons}.items())


def environment(*folders: Path) -> Environment:
    """Templates with the filters that pages share.

    Args:
        folders: Of further templates.
    """
    made = Environment(
        loader=FileSystemLoader([TEMPLATES, *folders]),
        autoescape=True,
        finalize=_shown,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters.update(number=summary.number, e5=summary.e5, technique=title, mib=_mib, count=_count)
    made.globals.update(figure=figure, scripts=scripts)
    return made


def _shown(value: Any) -> Any:
    """What stands in a page: `Markup` stays what it is."""
    return type(value)(visible(value)) if isinstance(value, str) else value


def _mib(size: int | None) -> str:
    return "–" if size is None else f"{size / 2**20:.1f}"


def _count(value: int) -> str:
    return f"{value:,}".replace(",", " ")
