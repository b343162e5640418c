"""From USD scenes to a trained, evaluated and published bundle."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from diaphane import shown
from diaphane.local.build import build as run
from diaphane.local.options import BuildOptions, asked
from diaphane.local.result import HEADINGS, BuildResult
from evaluation.progress import make_progress
from schemas.options import Options


class Built(BuildResult):
    """Outcome of a build that shows itself: what was published, and how it did on the scenes that were held out."""

    def _repr_html_(self) -> str:
        pairs = [("registry", self.registry.reference), ("bundle", self.registry.folder), ("report", self.report)]
        said = (self.verdict, self.registry.reason, self.licences)
        table = shown.table(HEADINGS, rows) if (rows := self.table()) else ""
        return shown.facts("Build", pairs) + shown.paragraphs(said) + table


def build(
    scenes: Sequence[str | Path],
    name: str,
    *,
    holdout: Sequence[str | Path] = (),
    licences: Mapping[str | Path, str] | None = None,
    views: str | Path | None = None,
    start: str | None = None,
    replay: str | Path | None = None,
    state: str | Path = ".diaphane",
    silent: bool = False,
    **options: Any,
) -> Built:
    """Render, label, train, evaluate, publish and report; what exists already is not made again.

    Args:
        scenes: USD files.
        name: Name of the bundle in the registry.
        holdout: Those that are evaluated on and never trained on; empty: a quarter.
        licences: Scene -> its licence, instead of what its stage states.
        views: JSON file with views; None: the stages' cameras.
        start: Bundle that the training begins with: a folder, or NAME@ALIAS of the registry.
        replay: Data set of `start` that is trained on again.
        state: Folder of artifacts, registry and reports.
        silent: Whether no progress is written to stderr.
        options: Fields of `schemas.options.Options`, such as `width=320, steps=2000, budgets=(1.0, 2.0)`.

    Raises:
        Problem: An argument cannot be used, or a check does not hold.
    """
    wanted = BuildOptions(
        scenes=tuple(map(Path, scenes)),
        name=name,
        options=asked(Options, options),
        holdout=tuple(map(Path, holdout)),
        licences={Path(scene): said for scene, said in (licences or {}).items()},
        views=None if views is None else Path(views),
        start=start,
        replay=None if replay is None else Path(replay),
        state=Path(state),
    )
    result = run(wanted, make_progress(sys.stderr, silent=silent))
    return Built(**{field: getattr(result, field) for field in BuildResult.model_fields})
