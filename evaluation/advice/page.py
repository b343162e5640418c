"""The page of a piece of advice: one HTML file that needs no network; and the part of it that other pages show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from markupsafe import Markup

from evaluation.advice import words
from evaluation.advice.charts import error_chart
from evaluation.report.page import environment
from schemas.advice import Advice

if TYPE_CHECKING:
    from evaluation.advice.sheet import Sheet


def page(parts: Sequence[tuple[Advice, Sheet | None]], command: str) -> str:
    """HTML of advice on some scenes.

    Args:
        parts: Of each scene its advice and its contact sheet.
        command: How it was asked for.
    """
    shown = [(advice.scene.name, part(advice, sheet)) for advice, sheet in parts]
    return environment().get_template("advice.html.j2").render(parts=shown, command=command)


def part(advice: Advice, sheet: Sheet | None = None) -> Markup:
    """HTML of advice on a scene without its heading, to stand in a page that includes `report.css`."""
    made = environment().get_template("advice_part.html.j2")
    return Markup(made.render(advice=advice, sheet=sheet, words=words, chart=error_chart))
