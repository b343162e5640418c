"""Made-up numbers of a scene."""

from __future__ import annotations

from typing import Any

from evaluation.advice.rules import candidates
from schemas.advice import AdvisedScene, Sample, SeenView, Size, sbuffer_bytes

FRAME = Size(width=1000, height=1000)
MIB = 2**20


def sample(technique: str, pixel_bytes: float, mse: float, budget: float | None = None, **more: Any) -> Sample:
    """A bounded technique with a budget, else an approximate one."""
    given = {"view": "front", "family": "approximate" if budget is None else "bounded", **more}
    return Sample(technique=technique, pixel_bytes=pixel_bytes, mse=mse, budget=budget, **given)


def scene(load: float, *samples: Sample) -> AdvisedScene:
    """A scene with one view, its S-buffer and other samples."""
    exact = Sample(view="front", technique="sbuffer", family="exact", pixel_bytes=sbuffer_bytes(load), mse=0.0)
    return AdvisedScene(
        name="panes",
        views=(SeenView(name="front", load=load, most=round(4 * load)),),
        counted=FRAME,
        measured=Size(width=100, height=100),
        candidates=candidates([exact, *samples], ["front"]),
    )
