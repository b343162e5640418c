"""The charts of a piece of advice."""

from __future__ import annotations

from markupsafe import Markup

from schemas.advice import Advice, Candidate
from services.report import charts
from services.summary import Row


def error_chart(advice: Advice) -> Markup:
    """Error against MiB at the size asked for: every technique and budget, the S-buffer as a line at its memory."""
    pixels = advice.choice.size.pixels
    rows = [_row(one, pixels) for one in advice.scene.candidates if not one.is_exact or one in advice.front]
    label = f"{advice.scene.name}, {advice.choice.size}"
    svg = charts.error_chart(rows, label, charts.MEMORY)
    legend = charts.legend([row.technique for row in rows if row.budget_factor])
    return Markup(f"{legend}<figure>{svg}</figure>") if svg else Markup("")


def _row(one: Candidate, pixels: int) -> Row:
    return Row(
        technique=one.technique,
        budget_factor=one.budget or 0.0,
        mse=None if one.is_exact else one.mse,
        psnr=None,
        flip=None,
        ms=None,
        pool_bytes=None,
        total_bytes=one.bytes_at(pixels),
        views=1,
        exact_views=0,
        over_baseline=None,
    )
