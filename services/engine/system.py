"""DBOS by its public calls and its documented table of workflows: `tests/integration/test_engine_contract.py`.

DBOS gives durable queues: a workflow is a row that one executor at a time claims. Everything that a user sees lies in
tables of our own, in the same database, so that a state and what is queued for it change in one transaction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import sqlalchemy as sa

from services.database import Database

if TYPE_CHECKING:
    from dbos import DBOSClient

APPLICATION: Final = "diaphane"
VERSION: Final = "1"
"""Changed by hand when the order of a workflow's steps changes: executors run workflows of their own version only."""

LIVE: Final = ("ENQUEUED", "DELAYED", "PENDING")
LOST: Final = "MAX_RECOVERY_ATTEMPTS_EXCEEDED"
SCHEMA: Final = "dbos"

_COLUMNS = (
    *("workflow_uuid", "status", "name", "executor_id", "application_version", "queue_name", "priority"),
    *("recovery_attempts", "owner_xid", "started_at_epoch_ms", "updated_at", "completed_at", "created_at"),
    *("deduplication_id", "delay_until_epoch_ms"),
)


def workflows(database: Database) -> sa.TableClause:
    """DBOS's table of workflows."""
    return _table(SCHEMA if database.is_postgresql else None)


@cache
def _table(schema: str | None) -> sa.TableClause:
    """One object for each schema: conditions on one belong to statements on the same."""
    columns: list[sa.ColumnClause[Any]] = [sa.column(name) for name in _COLUMNS]
    return sa.table("workflow_status", *columns, schema=schema)


def engine_url(url: str) -> str:
    """The database's URL as DBOS writes it."""
    return "postgresql://" + url.removeprefix("postgres://") if url.startswith("postgres://") else url


def migrate(database: Database) -> None:
    """Makes DBOS's tables, and the index that workflows are found by the beginning of their ids with."""
    from dbos import DBOS

    _quiet()
    DBOS.migrate(engine_url(database.url))
    if database.is_postgresql:
        index = f"create index if not exists diaphane_ids on {SCHEMA}.workflow_status (workflow_uuid text_pattern_ops)"
        with database.write() as connection:
            connection.exec_driver_sql("select pg_advisory_xact_lock(1684105321)")
            connection.exec_driver_sql(index)


def open_client(database: Database) -> DBOSClient:
    """Queues workflows, without running any."""
    from dbos import DBOSClient, DBOSPortableJSONSerializer

    return DBOSClient(
        system_database_url=engine_url(database.url),
        serializer=DBOSPortableJSONSerializer(),
        application_name=APPLICATION,
        system_database_pool_size=2,
        lazy=True,
    )


def enqueue(
    client: DBOSClient,
    connection: sa.Connection,
    workflow: str,
    workflow_id: str,
    queue: str,
    *arguments: Any,
    priority: int,
    delay: float = 0.0,
) -> None:
    """Queues a workflow within the caller's transaction; one of the same id is left as it is.

    Args:
        client: Of the same database.
        connection: The caller's transaction.
        workflow: Name of the workflow function.
        workflow_id: Its id.
        queue: Which workers take it.
        arguments: JSON values.
        priority: The smaller, the earlier.
        delay: Seconds before it can be taken.
    """
    options: dict[str, Any] = {
        "workflow_name": workflow,
        "queue_name": queue,
        "workflow_id": workflow_id,
        "app_version": VERSION,
        "priority": priority,
    }
    if delay > 0.0:
        options["delay_seconds"] = delay
    client.enqueue_in_transaction(connection, options, *arguments)  # type: ignore[arg-type]


def under(table: sa.TableClause, prefix: str, database: Database) -> sa.ColumnElement[bool]:
    """Workflows whose ids begin with `prefix`, by an index on either database."""
    column = table.c.workflow_uuid
    if database.is_postgresql:
        return column.startswith(prefix, autoescape=True)
    return sa.and_(column >= prefix, column < prefix[:-1] + chr(ord(prefix[-1]) + 1))


def owns(connection: sa.Connection, database: Database, workflow_id: str, executor: str) -> bool:
    """Whether an executor still has its claim; it cannot be lost before the transaction ends."""
    table = workflows(database)
    found = sa.select(table.c.workflow_uuid).where(
        table.c.workflow_uuid == workflow_id, table.c.status == "PENDING", table.c.executor_id == executor
    )
    return connection.execute(found.with_for_update(read=True)).first() is not None


def live(connection: sa.Connection, database: Database, prefix: str) -> int:
    """How many workflows under a prefix wait or run."""
    table = workflows(database)
    counted = sa.select(sa.func.count()).where(under(table, prefix, database), table.c.status.in_(LIVE))
    return int(connection.scalar(counted) or 0)


def live_ids(connection: sa.Connection, database: Database, prefix: str) -> list[str]:
    """Ids of the workflows under a prefix that wait or run."""
    table = workflows(database)
    found = sa.select(table.c.workflow_uuid).where(under(table, prefix, database), table.c.status.in_(LIVE))
    return list(connection.scalars(found))


def statuses(connection: sa.Connection, database: Database, prefix: str) -> list[tuple[str, str]]:
    """Id and status of all workflows under a prefix."""
    table = workflows(database)
    found = sa.select(table.c.workflow_uuid, table.c.status).where(under(table, prefix, database))
    return [(row[0], row[1]) for row in connection.execute(found.order_by(table.c.workflow_uuid))]


def first_priority(connection: sa.Connection, database: Database, prefix: str) -> int | None:
    """The earliest turn that a workflow under a prefix had; None if there is none."""
    table = workflows(database)
    found = connection.scalar(sa.select(sa.func.min(table.c.priority)).where(under(table, prefix, database)))
    return None if found is None else int(found)


def status(connection: sa.Connection, database: Database, workflow_id: str) -> str | None:
    """Status of one workflow; None if there is none."""
    table = workflows(database)
    return connection.scalar(sa.select(table.c.status).where(table.c.workflow_uuid == workflow_id))


def cancel(connection: sa.Connection, database: Database, which: sa.ColumnElement[bool]) -> int:
    """Cancels workflows that wait or run, as `DBOS.cancel_workflows` does; how many."""
    table, now = workflows(database), _milliseconds(database)
    values: dict[str, Any] = {"status": "CANCELLED", "owner_xid": None, "queue_name": None, "deduplication_id": None}
    values |= {"started_at_epoch_ms": None, "updated_at": now, "completed_at": now}
    return connection.execute(table.update().where(which, table.c.status.in_(LIVE)).values(**values)).rowcount


def hand_back(connection: sa.Connection, database: Database, executor: str, ids: Iterable[str] | None = None) -> int:
    """Queues again what an executor has claimed and does not do; the claim does not count as an attempt.

    Args:
        connection: The caller's transaction.
        database: The same database.
        executor: Who gives back.
        ids: Which of its workflows; None: all.
    """
    table = workflows(database)
    mine = [table.c.status == "PENDING", table.c.executor_id == executor]
    if ids is not None:
        mine.append(table.c.workflow_uuid.in_(list(ids)))
    attempts = sa.case((table.c.recovery_attempts > 0, table.c.recovery_attempts - 1), else_=0)
    return _queue_again(connection, database, mine, recovery_attempts=attempts)


def recover(connection: sa.Connection, database: Database, executors: Sequence[str]) -> int:
    """Queues again what dead executors have claimed; each claim counts as a lost attempt. How many.

    DBOS's public `resume_workflows` asks neither who has a workflow nor whether it was cancelled, and counts attempts
    anew: called a moment late it takes a task from the living or runs what was cancelled, and no task would ever be
    given up. So the condition and the change are one statement here. Rows that somebody else changes at this moment
    are left for the next look: no two processes wait for each other's rows.
    """
    table = workflows(database)
    theirs = [table.c.status == "PENDING", table.c.executor_id.in_(list(executors))]
    theirs.append(table.c.application_version == VERSION)
    found = list(connection.scalars(sa.select(table.c.workflow_uuid).where(*theirs).with_for_update(skip_locked=True)))
    return _queue_again(connection, database, [*theirs, table.c.workflow_uuid.in_(found)]) if found else 0


def _queue_again(
    connection: sa.Connection, database: Database, which: Sequence[sa.ColumnElement[bool]], **more: Any
) -> int:
    values: dict[str, Any] = {"status": "ENQUEUED", "owner_xid": None, "started_at_epoch_ms": None}
    values |= {"updated_at": _milliseconds(database), **more}
    return connection.execute(workflows(database).update().where(*which).values(**values)).rowcount


def owned(connection: sa.Connection, database: Database, executor: str) -> set[str]:
    """Ids of the workflows that an executor has claimed."""
    table = workflows(database)
    mine = sa.select(table.c.workflow_uuid).where(table.c.status == "PENDING", table.c.executor_id == executor)
    return set(connection.scalars(mine))


def owners(connection: sa.Connection, database: Database) -> set[str]:
    """Executors that have claimed anything."""
    table = workflows(database)
    found = sa.select(table.c.executor_id).where(table.c.status == "PENDING", table.c.application_version == VERSION)
    return {executor for executor in connection.scalars(found.distinct()) if executor is not None}


def once(name: str, body: Callable[[], Any]) -> Any:
    """Runs a step of the workflow that this thread runs, or gives its JSON result if the workflow has run it before.

    Raises:
        Ended: The workflow is not this process's any more; nothing is remembered.
    """
    from dbos import DBOS
    from dbos import error as errors

    try:
        return DBOS.run_step({"name": name}, body)
    except (errors.DBOSWorkflowCancelledError, errors.DBOSWorkflowConflictIDError) as error:
        raise Ended(name) from error


class Ended(Exception):
    """A workflow that was cancelled, or that another process runs."""


def remove(client: DBOSClient, ids: Sequence[str]) -> None:
    """Removes finished workflows with all that DBOS keeps of them."""
    for start in range(0, len(ids), 500):
        client.delete_workflows(list(ids[start : start + 500]))


def waiting(database: Database) -> sa.Select[Any]:
    """Whether anything waits in the queue `queue`: one row or none."""
    table = workflows(database)
    here = [
        table.c.queue_name == sa.bindparam("queue", type_=sa.Text),
        table.c.status == sa.literal_column("'ENQUEUED'"),
    ]
    if not database.is_postgresql:  # what SQLite takes the partial index for: its condition, word for word
        here.append(sa.literal_column("status in ('ENQUEUED', 'PENDING')"))
    return sa.select(sa.literal_column("1")).select_from(table).where(*here).limit(1)


def _milliseconds(database: Database) -> sa.ColumnElement[Any]:
    if database.is_postgresql:
        return sa.literal_column("(extract(epoch from clock_timestamp()) * 1000)::bigint")
    return sa.literal_column("cast((julianday('now') - 2440587.5) * 86400000 as integer)")


def _quiet() -> None:
    """DBOS writes through the service's logging, or not at all."""
    import logging

    logger = logging.getLogger("dbos")
    if not logger.handlers:
        logger.addHandler(logging.NullHandler())
        logger.setLevel(logging.WARNING)
