"""The one place that knows DBOS's tables and inner names; `tests/integration/test_engine_contract.py` guards them.

DBOS gives durable queues: a workflow is a row that one executor at a time claims. Everything that a user sees lies in
tables of our own, in the same database, so that a state and what is queued for it change in one transaction.
"""

from __future__ import annotations

import threading
import time
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
LONGEST_WAIT_SECONDS = 2.0
"""Before DBOS asks again for a database that did not answer."""
QUEUE_SECONDS = 5.0
"""For so long a process goes by what it has read of a queue: nothing there changes while a service runs."""

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
    values: dict[str, Any] = {"status": "ENQUEUED", "owner_xid": None, "started_at_epoch_ms": None}
    values |= {"recovery_attempts": attempts, "updated_at": _milliseconds(database)}
    return connection.execute(table.update().where(*mine).values(**values)).rowcount


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


def recover(executors: Sequence[str]) -> None:
    """Queues again what dead executors had claimed. The name is DBOS's own; it counts as a lost attempt."""
    from dbos import DBOS

    DBOS._recover_pending_workflows(list(executors))


def once(name: str, body: Callable[[], Any]) -> Any:
    """Runs a step of the workflow that this thread runs, or gives its JSON result if the workflow has run it before.

    Raises:
        Ended: The workflow is not this process's any more; nothing is remembered.
    """
    from dbos import DBOS
    from dbos._error import DBOSWorkflowCancelledError, DBOSWorkflowConflictIDError

    try:
        return DBOS.run_step({"name": name}, body)
    except (DBOSWorkflowCancelledError, DBOSWorkflowConflictIDError) as error:
        raise Ended(name) from error


class Ended(Exception):
    """A workflow that was cancelled, or that another process runs."""


def remove(client: DBOSClient, ids: Sequence[str]) -> None:
    """Removes finished workflows with all that DBOS keeps of them."""
    for start in range(0, len(ids), 500):
        client.delete_workflows(list(ids[start : start + 500]))


def steer_claims(database: Database, slots: dict[str, int]) -> None:
    """Bounds what this process claims of each queue, and has it ask for work in a tenth of a millisecond.

    DBOS keeps a queue's concurrency in the database, the same for all workers, but machines differ: the process's own
    number is put into what it reads there. And DBOS looks into a queue with two transactions, whether anything waits
    or not: 3 ms of the processor at every poll of every process. So one short statement is asked first, as often as
    before, and DBOS claims where it finds something.

    Args:
        database: That the queues are in.
        slots: How much this process does of each queue at once; the dictionary may change at any time.
    """
    from dbos._dbos import _get_dbos_instance

    system_database = _get_dbos_instance()._sys_db
    read, read_at, queues = system_database.get_queue, dict[str, float](), dict[str, Any]()
    waits = _Waits(database)

    def get_queue(name: str, **options: Any) -> Any:
        now = time.monotonic()
        if name not in queues or now - read_at[name] > QUEUE_SECONDS:
            queues[name], read_at[name] = read(name, **options), now
        queue = queues[name]
        if queue is not None:
            queue._worker_concurrency = slots.get(name, 0)
        return queue

    def dequeue_scopes(name: str) -> list[None]:
        return [None] if waits(name) else []

    vars(system_database).update(get_queue=get_queue, dequeue_scopes=dequeue_scopes)


class _Waits:
    """Asks whether anything waits in a queue: by the driver, on a connection that each thread keeps."""

    def __init__(self, database: Database) -> None:
        self._database, self._own = database, threading.local()
        self._texts: dict[str, str] = {}

    def __call__(self, queue: str) -> bool:
        if not hasattr(self._own, "connection"):
            self._own.connection = self._connect()
        try:
            return bool(self._own.connection.execute(self._text(queue)).fetchall())
        except Exception:  # the server went away: the next look connects again
            self._own.connection.close()
            del self._own.connection
            raise

    def _connect(self) -> Any:
        pooled = self._database.engine.raw_connection()
        connection: Any = pooled.driver_connection
        pooled.detach()
        if self._database.is_postgresql:  # to SQLite's it is by our own setting
            connection.autocommit = True
        return connection

    def _text(self, queue: str) -> str:
        if queue not in self._texts:
            asked = waiting(self._database).params(queue=queue)
            options = {"literal_binds": True}
            self._texts[queue] = str(asked.compile(self._database.engine, compile_kwargs=options))
        return self._texts[queue]


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


def bound_waits() -> None:
    """Bounds how long this process stays away from a database that is back, or that others use as well.

    DBOS doubles its wait after every connection that failed, up to 90 s: after an outage of a minute a worker may do
    nothing for as long again. It also doubles the time between two looks into a queue, up to 120 s, whenever another
    worker claimed from it at the same moment; here it looks again at the next poll, as it does where a lock is held.
    """
    import dbos._sys_db
    from dbos._dbos import _get_dbos_instance

    vars(dbos._sys_db)["time"] = _ShortWaits()
    system_database = _get_dbos_instance()._sys_db
    is_locked, is_contended = system_database.is_lock_conflict, system_database.is_serialization_conflict

    def conflicts(error: Any) -> bool:
        return is_locked(error) or is_contended(error)

    vars(system_database)["is_lock_conflict"] = conflicts


class _ShortWaits:
    """The module `time` with a bound on `sleep`."""

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)

    def sleep(self, seconds: float) -> None:
        time.sleep(min(seconds, LONGEST_WAIT_SECONDS))


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
