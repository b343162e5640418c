"""The chart of a piece of advice."""

from __future__ import annotations

from evaluation.report import fronts
from evaluation.report.vega import Spec
from schemas.advice import Advice, Candidate


def error_chart(advice: Advice) -> Spec | None:
    """Error against MiB at the size asked for: every technique and budget, exact ones that are on the front."""
    pixels = advice.choice.size.pixels
    points = [_point(one, pixels) for one in advice.scene.candidates if not one.is_exact or one in advice.front]
    return fronts.error_chart(points, f"{advice.scene.name}, {advice.choice.size}", fronts.MEMORY)


def _point(one: Candidate, pixels: int) -> fronts.Point:
    return fronts.Point(
        technique=one.technique,
        budget_factor=one.budget,
        cost=one.bytes_at(pixels) / 2**20,
        mse=0.0 if one.is_exact else one.mse,
    )
