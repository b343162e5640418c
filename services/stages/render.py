"""Stage `render`: the fragment dump of a view."""

from __future__ import annotations

from pathlib import Path

from renderer.capture import capture
from renderer.dump import write_dump
from services.stages.desk import Desk, save_facts
from services.tasks import Report, Task


def make(desk: Desk, task: Task, folder: Path, report: Report) -> None:
    """Writes the dump, and how many fragments it has and what each pass took, ms."""
    captured = capture(desk.frame(task))
    report(0.5, f"{captured.dump.total:,} fragments")
    write_dump(folder, captured.dump)
    occupied = int((captured.dump.counts > 0).sum())
    save_facts(folder, {"total": captured.dump.total, "occupied": occupied, "passes": captured.passes})
