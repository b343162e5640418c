"""Stage `report`: the HTML page of a build, with pictures of some views."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stages.stage import Facts, Params, Stage
from stages.tasks import Task


class ReportParams(Params):
    """What a report shows.

    Attributes:
        data: `schemas.measurement.ReportData` without what can be told where it is written, JSON.
        labels: Of the scene of every evaluation, in the order of the needs.
    """

    data: dict[str, Any]
    labels: tuple[str, ...]


class ReportFacts(Facts):
    """Hex sha256 and size of the page."""

    sha256: str
    bytes: int


class Report(Stage[ReportParams, ReportFacts]):
    """Writes reports."""

    name, role, title, share = "report", "render", "report", 1.0
    after = ("evaluate",)
    params, facts = ReportParams, ReportFacts

    def ask(self, name: str, data: Mapping[str, Any], evaluations: Sequence[tuple[str, Task]]) -> Task:
        """The task of a report.

        Args:
            name: Of the report.
            data: See `ReportParams`.
            evaluations: Label of the scene and task, for every evaluation that is shown.
        """
        params = ReportParams(data=dict(data), labels=tuple(label for label, _ in evaluations))
        made = [task for _, task in evaluations]
        return self.task(
            name, params, inputs=[task.address.key for task in made], needs=[task.artifact for task in made]
        )

    def known(self, task: Task) -> str:
        """See `Stage.known`."""
        return "reports already written"


REPORT = Report()
