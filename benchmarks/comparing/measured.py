"""The committed results of the suite, and what they say of its techniques as a build's measurements do."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from evaluation.bench.groups import said_setting
from schemas.bench import BenchResult
from schemas.measurement import Measurement
from schemas.tail import TailName

RESULTS: Final = Path(__file__).resolve().parents[1] / "results"


def read_lines(path: Path) -> BenchResult:
    """A committed result: a line for all but the views, then a line for each view."""
    head, *views = map(json.loads, path.read_text(encoding="utf-8").splitlines())
    return BenchResult.model_validate({**head, "views": views})


def measurements_of(result: BenchResult, tail: TailName) -> Iterator[Measurement]:
    """What was measured within budgets of fragments, by the techniques of one tail.

    A view is named with its opacity and size, since a suite measures it in several.

    Args:
        result: Of the suite.
        tail: Of the bundle.
    """
    for view in result.views:
        for cell in view.cells:
            if cell.basis != "fragments" or cell.tail != tail or cell.mse is None or not cell.budget:
                continue
            yield Measurement(
                scene=view.scene,
                view=f"{view.view}, {said_setting(view)}",
                technique=cell.technique,
                budget=cell.budget,
                budget_factor=cell.budget_factor or 0.0,
                width=view.width,
                height=view.height,
                alpha=view.alpha,
                tail=tail,
                mse=cell.mse,
                psnr=cell.psnr,
                flip=cell.flip,
                total_fragments=view.fragments,
                exact=cell.exact,
            )
