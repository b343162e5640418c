"""A page that shows a training while it goes on: one file, rewritten, that a browser loads again by itself."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from html import escape
from pathlib import Path

from evaluation.report.lines import loss_chart, training_chart
from evaluation.report.page import TEMPLATES
from evaluation.report.vega import figure, scripts
from schemas.measurement import TrainingPoint
from trainer.log import LogLine

REFRESH_SECONDS = 3
"""How often the page is loaded again while the training goes on."""


def write_live(path: Path, name: str, lines: Sequence[LogLine], steps: int, *, is_over: bool = False) -> None:
    """Writes the page of a training, replacing it in one step. It needs no server and no network.

    Args:
        path: The HTML file; its folder exists.
        name: Of the training.
        lines: Its log.
        steps: Steps that it will take.
        is_over: Whether it has ended: the page is not loaded again.
    """
    history = [TrainingPoint(step=x.step, loss=x.loss, over_optimum=x.score) for x in lines if x.score is not None]
    again = "" if is_over else f'<meta http-equiv="refresh" content="{REFRESH_SECONDS}">'
    css = (TEMPLATES / "report.css").read_text(encoding="utf-8")
    text = (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">{again}<title>{escape(name)}: training</title>'
        f"<style>{css}</style></head><body><main><h1>Training of {escape(name)}</h1>\n<p>{_state(lines, steps)}</p>\n"
        f"<h2>Loss</h2>{figure(loss_chart([(x.step, x.loss) for x in lines]))}\n"
        f"<h2>Error over the optimum</h2>{figure(training_chart(history))}\n</main>{scripts()}"
        "</body></html>\n"
    )
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    temporary.write_text(text, encoding="utf-8")
    temporary.replace(path)


def _state(lines: Sequence[LogLine], steps: int) -> str:
    if not lines:
        return "It has not begun."
    last = lines[-1]
    return (
        f"Step {last.step} of {steps}, {last.seconds:.0f} s, {last.rows_per_second:,.0f} rows/s, "
        f"learning rate {last.lr:.2g}, loss {last.loss:.4g}."
    )
