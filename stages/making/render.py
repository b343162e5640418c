"""The fragment dump of a view."""

from __future__ import annotations

from pathlib import Path

from evaluation.wording import counted
from renderer.capture import capture
from renderer.dump import write_dump
from stages.desk import Desk
from stages.pictured import Pictured
from stages.render import RenderFacts
from stages.tasks import Report, Task


def make(desk: Desk, task: Task, params: Pictured, folder: Path, report: Report) -> RenderFacts:
    """Writes the dump."""
    captured = capture(desk.frame(task, params))
    report(0.5, counted(captured.dump.total, "fragments"))
    write_dump(folder, captured.dump)
    occupied = int((captured.dump.counts > 0).sum())
    return RenderFacts(total=captured.dump.total, occupied=occupied, passes=captured.passes)
