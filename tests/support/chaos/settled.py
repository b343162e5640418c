"""What must hold of stand-ins: that of all jobs, and contents, bodies and measurements as they should be."""

from __future__ import annotations

from collections.abc import Sequence

import sqlalchemy as sa

from services.database import tables
from stages.tasks import FACTS
from support.chaos.arena import Arena
from support.chaos.bodies import DATA, TECHNIQUES, content
from support.settled import Settled, settled


def look(arena: Arena, job_ids: Sequence[str], since: int = 0) -> Settled:
    """Looks at jobs that have ended.

    Args:
        arena: The service.
        job_ids: Jobs of different specs, all that ran meanwhile.
        since: Lines of the trace that came before.
    """
    found, artifacts = settled(arena.service, job_ids)
    lines = arena.trace()[since:]
    found.bodies = sum("artifact" in line and line["point"].endswith(":begin") for line in lines)
    whole = artifacts - set(found.damaged)
    found.damaged += [artifact for artifact in sorted(whole) if not _is_as_made(arena, artifact)]
    _look_at_measurements(arena, job_ids, found)
    return found


def require(arena: Arena, job_ids: Sequence[str], in_vain: int) -> Settled:
    """Asserts that nothing was lost and nothing done twice.

    Args:
        arena: The service.
        job_ids: Jobs of different specs, all that ran since the gates were last shut.
        in_vain: How many bodies may have run without their artifact being kept.
    """
    found = look(arena, job_ids, arena.mark)
    assert not found.faults, f"{found.faults}\n{arena.logs()}"
    assert found.published == len(job_ids)
    assert found.artifacts <= found.bodies <= found.artifacts + in_vain, (found, in_vain)
    return found


def _is_as_made(arena: Arena, artifact: str) -> bool:
    """Whether it has the content that follows from its key."""
    folder = arena.service.storage.store.fetch(artifact)
    return (folder / DATA).read_bytes() == content(artifact) and (folder / FACTS).is_file()


def _look_at_measurements(arena: Arena, job_ids: Sequence[str], found: Settled) -> None:
    table = tables.measurements
    counted = sa.select(table.c.artifact, sa.func.count()).group_by(table.c.artifact)
    with arena.service.database.read() as connection:
        counts = {row[0]: row[1] for row in connection.execute(counted)}
    for job_id in job_ids:
        for task in arena.service.jobs.tasks(job_id, stage="evaluate", limit=10_000):
            expected = len(TECHNIQUES) if task.name.endswith("baseline") else 1
            if "published" not in task.name and counts.get(task.artifact, 0) != expected:
                found.records.append(f"{job_id} {task.name}: {counts.get(task.artifact, 0)} measurements")
