"""What a build hands back to whoever asked for it."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from schemas.measurement import Measurement, RegistryResult


class BuildResult(BaseModel):
    """Outcome of `services.build.build`.

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
