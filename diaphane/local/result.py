"""What a build hands back to whoever asked for it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from pydantic import BaseModel, ConfigDict

from evaluation import summary
from evaluation.looks import title
from schemas.measurement import Measurement, RegistryResult

HEADINGS: Final = ("F / WH", "technique", "MSE x1e-5", "/ VKB", "PSNR dB", "FLIP", "ms")
"""Of `BuildResult.table`; the first two are of columns of text."""
UNPROVEN: Final = (
    "No view of a scene that was held out was scored, so nothing is proven: give a second transparent scene."
)


class BuildResult(BaseModel):
    """Outcome of `diaphane.local.build.build`.

    Attributes:
        report: The HTML report.
        dataset: Folder of the data set: index and shards.
        registry: What became of the bundle.
        licences: Whether the licences of its training scenes allow commercial use, in a sentence.
        held_out: Labels of the scenes that were evaluated on and not trained on; empty if there was only one scene.
        measurements: Of all techniques, views and budgets.
        skipped: What was not done because it did not need to be, with counts.
        worked: Whether any artifact was made; False if every one of them was there already.
        seconds: Wall time.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    report: Path
    dataset: Path
    registry: RegistryResult
    licences: str
    held_out: tuple[str, ...]
    measurements: tuple[Measurement, ...]
    skipped: dict[str, int]
    worked: bool
    seconds: float

    @property
    def scored(self) -> list[Measurement]:
        """Measurements of the scenes that were held out."""
        return [one for one in self.measurements if one.scene in self.held_out]

    @property
    def verdict(self) -> str:
        """What the scenes that were held out prove, in a sentence."""
        return summary.sentence(self.scored) if self.scored else UNPROVEN

    def table(self) -> list[list[str]]:
        """Each budget and technique on the scenes that were held out."""
        rows = []
        for row in summary.rows(self.scored):
            scaled = None if row.mse is None else row.mse * 1e5
            values = (scaled, row.over_baseline, row.psnr, row.flip, row.ms)
            rows.append([summary.number(row.budget_factor), title(row.technique), *map(summary.number, values)])
        return rows
