"""What a process was doing when it was killed, and when that is being done again: read from the service's database."""

from __future__ import annotations

from dataclasses import dataclass

import sqlalchemy as sa

from schemas.job import FINAL_STATES
from services.database import Database, tables
from services.engine import system

_ENDED = ("done", "skipped", "quarantined", "cancelled")


@dataclass(frozen=True)
class Held:
    """A task that runs.

    Attributes:
        job_id: Of which job.
        position: Which of its tasks.
        stage: Of which stage.
        started: When its body was begun, seconds since 1970 UTC.
    """

    job_id: str
    position: int
    stage: str
    started: float

    @property
    def place(self) -> tuple[str, int]:
        """Which task it is, however often it is begun."""
        return self.job_id, self.position


def claimed(database: Database, executor: str) -> set[str]:
    """Workflows that an executor has claimed."""
    with database.read() as connection:
        return system.owned(connection, database, executor)


def running(database: Database, executor: str) -> list[Held]:
    """Tasks whose bodies run in an executor's children."""
    table = tables.tasks
    mine = sa.select(table).where(table.c.executor == executor, table.c.state == "running")
    with database.read() as connection:
        rows = connection.execute(mine).all()
    return [Held(row.job_id, row.position, row.stage, row.started) for row in rows]


def are_taken_over(database: Database, workflows: set[str], dead: str) -> bool:
    """Whether other executors have claimed all of what a dead one had, or it has ended."""
    table = system.workflows(database)
    dead_has = sa.and_(table.c.status == "PENDING", table.c.executor_id == dead)
    waiting = dead_has | table.c.status.in_(("ENQUEUED", "DELAYED"))
    left = sa.select(sa.func.count()).where(table.c.workflow_uuid.in_(list(workflows)), waiting)
    with database.read() as connection:
        return not connection.scalar(left)


def is_begun_again(database: Database, held: Held) -> bool:
    """Whether a task whose child was killed runs again, or has ended."""
    table = tables.tasks
    here = sa.select(table.c.state, table.c.started).where(
        table.c.job_id == held.job_id, table.c.position == held.position
    )
    with database.read() as connection:
        row = connection.execute(here).one()
    return row.state in _ENDED or (row.state == "running" and row.started > held.started)


def ended_since(database: Database, moment: float) -> bool:
    """Whether a task was done since a moment, or no job is left that could have one."""
    task, job = tables.tasks, tables.jobs
    later = sa.select(sa.func.count()).where(task.c.state == "done", task.c.finished > moment)
    open_jobs = sa.select(sa.func.count()).where(job.c.state.not_in(FINAL_STATES))
    with database.read() as connection:
        return bool(connection.scalar(later)) or not connection.scalar(open_jobs)
