"""Transitions of jobs, each one transaction.

    queued -> running -> succeeded | failed
       |         |
       |         +-> cancelling -> cancelled
       +-> cancelled
    failed | cancelled -> queued (the next attempt)

Rules:
- locks are taken in one order: the job's row, the workflow's row, the tasks' rows;
- whoever writes for a workflow still has its claim: what a process writes after it was taken for dead is refused.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import sqlalchemy as sa
from sqlalchemy.exc import DBAPIError, OperationalError

from schemas.job import FINAL_STATES
from schemas.service import ProblemDocument
from services.database import Database, tables
from services.engine import events, system
from services.webhooks import outbox

T = TypeVar("T")

PATIENCE_SECONDS = 24 * 3600.0
"""How long a worker waits for the database to come back."""


class Abandoned(BaseException):
    """The workflow is no longer this process's: it stops, and leaves it to whoever has it now.

    Not an `Exception`: no stage may take it for an error, and DBOS records it nowhere.
    """


class Cancelled(BaseException):
    """The job is to end. Not an `Exception`: no stage may take it for an error."""


def workflow_of(job_id: str, attempt: int) -> str:
    """Id of the workflow that conducts a job."""
    return f"{job_id}.{attempt}"


def prefix_of(job_id: str, attempt: int) -> str:
    """What the ids of all task workflows of a job begin with."""
    return f"{job_id}.{attempt}/"


@dataclass(frozen=True, slots=True)
class Claim:
    """A workflow that an executor has claimed."""

    workflow_id: str
    executor: str

    def check(self, connection: sa.Connection, database: Database) -> None:
        """Makes sure of the claim until the transaction ends.

        Raises:
            Abandoned: Somebody else has it, or it was cancelled.
        """
        if not system.owns(connection, database, self.workflow_id, self.executor):
            raise Abandoned(self.workflow_id)


def lock_job(connection: sa.Connection, job_id: str) -> sa.Row[Any] | None:
    """The job's row, locked until the transaction ends."""
    return connection.execute(sa.select(tables.jobs).where(tables.jobs.c.id == job_id).with_for_update()).first()


def begin_job(database: Database, claim: Claim, job_id: str, attempt: int) -> sa.Row[Any] | None:
    """A job leaves the queue, or goes on in another process.

    Returns:
        Its row; None if there is nothing to do: it has ended, or another attempt has begun.
    """

    def body(connection: sa.Connection) -> sa.Row[Any] | None:
        row = lock_job(connection, job_id)
        if row is None or row.attempt != attempt or row.state in FINAL_STATES:
            return None
        claim.check(connection, database)
        if row.state == "queued":
            values = {"state": "running", "started": time.time()}
            connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(**values))
            events.add(connection, job_id, ("state", {"state": "running", "attempt": attempt}))
        return connection.execute(sa.select(tables.jobs).where(tables.jobs.c.id == job_id)).one()

    return database.retry(body, PATIENCE_SECONDS)


def end_job(
    database: Database,
    claim: Claim | None,
    job_id: str,
    attempt: int,
    state: str,
    *,
    problem: ProblemDocument | None = None,
    result: dict[str, Any] | None = None,
) -> bool:
    """A job ends; whether it did by this call.

    Args:
        database: The database.
        claim: Of the workflow that conducts it; None: it is conducted by nobody any more.
        job_id: The job.
        attempt: Which attempt ends.
        state: succeeded, failed or cancelled; a job that is being cancelled is cancelled whatever came of it.
        problem: Why it failed.
        result: What it made.
    """

    def body(connection: sa.Connection) -> bool:
        row = lock_job(connection, job_id)
        if row is None or row.attempt != attempt or row.state in FINAL_STATES:
            return False
        if claim is not None:
            claim.check(connection, database)
        final = "cancelled" if row.state == "cancelling" else state
        close(connection, database, row, final, problem if final == "failed" else None, result)
        return True

    return database.retry(body, PATIENCE_SECONDS)


def close(
    connection: sa.Connection,
    database: Database,
    row: sa.Row[Any],
    state: str,
    problem: ProblemDocument | None = None,
    result: dict[str, Any] | None = None,
) -> None:
    """Gives a job, whose row the caller has locked, its final state; nothing of it waits or runs afterwards."""
    document = None if problem is None else problem.model_dump(mode="json")
    values = {"state": state, "finished": time.time(), "stage": None, "problem": document, "result": result}
    connection.execute(tables.jobs.update().where(tables.jobs.c.id == row.id).values(**values))
    cancel_tasks(connection, database, row.id, row.attempt)
    open_tasks = [tables.tasks.c.job_id == row.id, tables.tasks.c.state.in_(("queued", "running"))]
    connection.execute(tables.tasks.update().where(*open_tasks).values(state="cancelled", finished=time.time()))
    data: dict[str, Any] = {"state": state, "attempt": row.attempt}
    events.add(connection, row.id, ("state", data if document is None else {**data, "problem": document}))
    outbox.job_ended(connection, row, state, problem, result)


def cancel_tasks(connection: sa.Connection, database: Database, job_id: str, attempt: int) -> None:
    """Cancels all task workflows of a job; their processes are ended by the next heartbeat of their workers."""
    table = system.workflows(database)
    system.cancel(connection, database, system.under(table, prefix_of(job_id, attempt), database))


def check_running(database: Database, claim: Claim, job_id: str) -> None:
    """Makes sure that a job is to go on.

    Raises:
        Cancelled: It is being cancelled.
        Abandoned: Another process conducts it.
    """

    def body(connection: sa.Connection) -> str | None:
        if claim.workflow_id not in system.owned(connection, database, claim.executor):
            raise Abandoned(claim.workflow_id)
        return connection.scalar(sa.select(tables.jobs.c.state).where(tables.jobs.c.id == job_id))

    if read(database, body) != "running":
        raise Cancelled(job_id)


def read(database: Database, body: Callable[[sa.Connection], T]) -> T:
    """Reads, and waits for a database that cannot be reached."""
    end, wait = time.monotonic() + PATIENCE_SECONDS, 0.1
    while True:
        try:
            with database.read() as connection:
                return body(connection)
        except DBAPIError as error:
            if not is_outage(error) or time.monotonic() > end:
                raise
            time.sleep(wait)
            wait = min(2.0, 2.0 * wait)


def is_outage(error: DBAPIError) -> bool:
    """Whether the database could not be reached, or was too busy."""
    return error.connection_invalidated or isinstance(error, OperationalError)


def note(database: Database, job_id: str, *found: events.Event, **values: Any) -> None:
    """Writes events and columns of a job."""

    def body(connection: sa.Connection) -> None:
        if values:
            connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(**values))
        events.append(connection, job_id, found)

    database.retry(body, PATIENCE_SECONDS)


def end_adrift(database: Database) -> list[str]:
    """Ends jobs that nobody conducts any more: their workflow has ended or is gone. Ids of those that were ended."""
    from services.engine.problems import LOST_JOB

    table, jobs = system.workflows(database), tables.jobs
    with database.read() as connection:
        id_of = jobs.c.id + "." + sa.cast(jobs.c.attempt, sa.Text)
        conducted = sa.select(table.c.workflow_uuid).where(
            table.c.workflow_uuid == id_of, table.c.status.in_(system.LIVE)
        )
        adrift = connection.execute(
            sa.select(jobs.c.id, jobs.c.attempt).where(jobs.c.state.not_in(FINAL_STATES), ~conducted.exists())
        ).all()
    ended = []
    for job_id, attempt in adrift:

        def body(connection: sa.Connection, job_id: str = job_id, attempt: int = attempt) -> bool:
            row = lock_job(connection, job_id)
            if row is None or row.attempt != attempt or row.state in FINAL_STATES:
                return False
            # Looked at again under the lock: the job may have ended, or begun anew, since.
            if system.status(connection, database, workflow_of(job_id, attempt)) in system.LIVE:
                return False
            cancelling = row.state == "cancelling"
            close(connection, database, row, "cancelled" if cancelling else "failed", None if cancelling else LOST_JOB)
            return True

        if database.retry(body, 0.0):
            ended.append(job_id)
    return ended
