"""What can be done with jobs from outside. It needs the database only, no process that runs work."""

from __future__ import annotations

import builtins
import hashlib
import time
import uuid
from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import sqlalchemy as sa
from sqlalchemy.exc import IntegrityError

from evaluation.wording import counted
from schemas.canonical import canonical_json
from schemas.job import FINAL_STATES, JobKind, JobSpec, JobState, TaskState
from schemas.problem import ExitCode, Problem
from schemas.service import EventRecord, ExecutorRecord, JobRecord, QueueRecord, TaskRecord
from services.acceptance import Accepted
from services.clock import iso
from services.database import Database, tables
from services.database.clock import clock
from services.engine import checks, events, progress, queues, states, system
from services.engine.events import Event
from services.settings import Settings
from stages.tasks import ROLES

if TYPE_CHECKING:
    from dbos import DBOSClient


class Jobs:
    """The jobs of a service.

    Args:
        settings: Of the service.
        database: The database; the tables of DBOS are made in it.
    """

    def __init__(self, settings: Settings, database: Database) -> None:
        self._settings, self._database = settings, database
        system.migrate(database)
        queues.register(self.client, settings)

    @cached_property
    def client(self) -> DBOSClient:
        """Queues workflows."""
        return system.open_client(self._database)

    def close(self) -> None:
        """Closes the connections."""
        self.client.destroy()

    def submit(
        self,
        spec: JobSpec,
        *,
        submitted_by: str,
        idempotency_key: str | None = None,
        request_id: str | None = None,
        accepted: Accepted | None = None,
        most: int | None = None,
    ) -> tuple[JobRecord, bool]:
        """Queues a job.

        Args:
            spec: What to do, as it was asked for.
            submitted_by: Id of the key.
            idempotency_key: Names the request, so that it can be repeated until an answer arrives.
            request_id: Of the request.
            accepted: What was decided of it; None: nothing had to be.
            most: Jobs of the key that may not have ended, this one included; None: any number.

        Returns:
            The job, and whether it is new: False if the same request came before.

        Raises:
            Problem: The idempotency key came with another job before, or the key has too many jobs under way.
        """
        digest, decided = _digest(spec), accepted or Accepted(spec)
        job_id = f"job_{uuid.uuid4().hex[:24]}"

        def body(connection: sa.Connection) -> tuple[str, bool]:
            earlier = _of_key(connection, submitted_by, idempotency_key)
            if earlier is not None:
                return _same(earlier, digest), False
            _require_place(connection, submitted_by, most)
            values: dict[str, Any] = {
                "id": job_id,
                "kind": spec.kind,
                "name": spec.name,
                "spec": decided.spec.model_dump(mode="json"),
            }
            values |= {"state": "queued", "attempt": 1, "priority": spec.priority, "created": time.time()}
            values |= {"submitted_by": submitted_by, "request_id": request_id, "last_event": 0, "skipped": {}}
            values |= {"idempotency_key": idempotency_key}
            values |= {"idempotency_digest": None if idempotency_key is None else digest}
            connection.execute(tables.jobs.insert().values(**values))
            notes: list[Event] = [("log", {"text": note}) for note in decided.notes]
            events.add(connection, job_id, ("state", {"state": "queued", "attempt": 1}), *notes)
            self._enqueue(connection, job_id, 1, spec)
            return job_id, True

        while True:
            try:
                found, new = self._database.retry(body)
                break
            except IntegrityError:
                # The same request at the same moment was first; or the answer to our own commit was lost.
                with self._database.read() as connection:
                    if _of_key(connection, submitted_by, idempotency_key) is not None:
                        continue
                    if connection.scalar(sa.select(tables.jobs.c.id).where(tables.jobs.c.id == job_id)) is None:
                        raise
                    found, new = job_id, True
                    break
        return self.get(found), new

    def repeated(self, spec: JobSpec, *, submitted_by: str, idempotency_key: str | None) -> JobRecord | None:
        """The job of a request that came before; see `submit`.

        Raises:
            Problem: The idempotency key came with another job before.
        """
        with self._database.read() as connection:
            earlier = _of_key(connection, submitted_by, idempotency_key)
        return None if earlier is None else self.get(_same(earlier, _digest(spec)))

    def get(self, job_id: str) -> JobRecord:
        """A job.

        Raises:
            Problem: There is none of this id.
        """
        with self._database.read() as connection:
            row = connection.execute(_SELECT.where(tables.jobs.c.id == job_id)).first()
            if row is None:
                raise _unknown(job_id)
            return self._records(connection, [row])[0]

    def list(
        self,
        *,
        state: JobState | None = None,
        kind: JobKind | None = None,
        name: str | None = None,
        limit: int = 50,
        after: tuple[float, str] | None = None,
    ) -> list[JobRecord]:
        """Jobs, newest first.

        Args:
            state: Only those in this state.
            kind: Only those of this kind.
            name: Only those that publish under this name.
            limit: At most so many.
            after: Time of creation (seconds since 1970) and id of the last one seen.
        """
        table, query = tables.jobs, _SELECT
        for column, value in ((table.c.state, state), (table.c.kind, kind), (table.c.name, name)):
            query = query if value is None else query.where(column == value)
        if after is not None:
            created, last = after
            older = sa.and_(table.c.created == created, table.c.id < last)
            query = query.where(sa.or_(table.c.created < created, older))
        with self._database.read() as connection:
            rows = connection.execute(query.order_by(table.c.created.desc(), table.c.id.desc()).limit(limit)).all()
            return self._records(connection, rows)

    def cancel(self, job_id: str) -> JobRecord:
        """Ends a job; one that has ended stays as it is.

        Raises:
            Problem: There is none of this id.
        """

        def body(connection: sa.Connection) -> None:
            row = states.lock_job(connection, job_id)
            if row is None:
                raise _unknown(job_id)
            if row.state == "queued":
                workflow = system.workflows(self._database).c.workflow_uuid == states.workflow_of(job_id, row.attempt)
                system.cancel(connection, self._database, workflow)
                states.close(connection, self._database, row, "cancelled")
            elif row.state == "running":
                connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(state="cancelling"))
                events.add(connection, job_id, ("state", {"state": "cancelling", "attempt": row.attempt}))
                states.cancel_tasks(connection, self._database, job_id, row.attempt)

        self._database.retry(body)
        return self.get(job_id)

    def retry(self, job_id: str, *, most: int | None = None) -> JobRecord:
        """Begins a failed or cancelled job anew; what it made before is found again.

        Args:
            job_id: The job.
            most: As in `submit`, of the key that submitted it.

        Raises:
            Problem: There is none of this id, or it has not failed, or the key has too many jobs under way.
        """

        def body(connection: sa.Connection) -> None:
            row = states.lock_job(connection, job_id)
            if row is None:
                raise _unknown(job_id)
            if row.state not in ("failed", "cancelled"):
                raise Problem(
                    f"The job {job_id} is {row.state}.",
                    "Retry a job that has failed or was cancelled.",
                    ExitCode.CONFLICT,
                )
            _require_place(connection, row.submitted_by, most)
            attempt = row.attempt + 1
            values: dict[str, Any] = {
                "state": "queued",
                "attempt": attempt,
                "stage": None,
                "started": None,
                "finished": None,
            }
            values |= {"problem": sa.null(), "result": sa.null(), "skipped": {}}
            connection.execute(tables.jobs.update().where(tables.jobs.c.id == job_id).values(**values))
            fresh = dict.fromkeys(("executor", "progress", "note", "started", "finished", "seconds"))
            mine = tables.tasks.c.job_id == job_id
            reset = tables.tasks.update().where(mine).values(state="queued", problem=sa.null(), **fresh)
            connection.execute(reset)
            events.add(connection, job_id, ("state", {"state": "queued", "attempt": attempt}))
            self._enqueue(connection, job_id, attempt, JobSpec.model_validate(row.spec))

        self._database.retry(body)
        return self.get(job_id)

    def tasks(
        self,
        job_id: str,
        *,
        stage: str | None = None,
        state: TaskState | None = None,
        limit: int = 100,
        after: tuple[str, int] | None = None,
    ) -> builtins.list[TaskRecord]:
        """Tasks of a job, by stage and position.

        Args:
            job_id: The job.
            stage: Only those of this stage.
            state: Only those in this state.
            limit: At most so many.
            after: Stage and position of the last one seen.

        Raises:
            Problem: There is no such job.
        """
        return [
            record for _, record in self.positioned_tasks(job_id, stage=stage, state=state, limit=limit, after=after)
        ]

    def positioned_tasks(
        self,
        job_id: str,
        *,
        stage: str | None = None,
        state: TaskState | None = None,
        limit: int = 100,
        after: tuple[str, int] | None = None,
    ) -> builtins.list[tuple[int, TaskRecord]]:
        """As `tasks`, each with its position: what the next page begins after."""
        table = tables.tasks
        query = sa.select(table).where(table.c.job_id == job_id)
        for column, value in ((table.c.stage, stage), (table.c.state, state)):
            query = query if value is None else query.where(column == value)
        if after is not None:
            last_stage, last = after
            later = sa.and_(table.c.stage == last_stage, table.c.position > last)
            query = query.where(sa.or_(table.c.stage > last_stage, later))
        with self._database.read() as connection:
            self._known(connection, job_id)
            rows = connection.execute(query.order_by(table.c.stage, table.c.position).limit(limit)).all()
        return [(row.position, _task_record(row)) for row in rows]

    def events(self, job_id: str, after: int = 0, limit: int = 500) -> builtins.list[EventRecord]:
        """What happened in a job, beyond number `after`.

        Raises:
            Problem: There is no such job.
        """
        with self._database.read() as connection:
            self._known(connection, job_id)
            return events.read(connection, job_id, after, limit)

    def queues(self) -> builtins.list[QueueRecord]:
        """How much waits and runs, by role, and of checks."""
        table = system.workflows(self._database)
        query = (
            sa.select(table.c.queue_name, table.c.status, sa.func.count().label("number"))
            .where(table.c.status.in_(system.LIVE), table.c.queue_name.in_(queues.QUEUES))
            .group_by(table.c.queue_name, table.c.status)
        )
        counts: Counter[tuple[str, bool]] = Counter()
        with self._database.read() as connection:
            for row in connection.execute(query):
                counts[row.queue_name, row.status == "PENDING"] += row.number
            open_checks = sa.select(sa.func.count()).where(tables.scenes.c.state == "checking")
            # Most of them wait in the queues of their keys.
            counts[queues.CHECKS, True] += counts[queues.LONG_CHECKS, True]
            waiting = int(connection.scalar(open_checks) or 0) - counts[queues.CHECKS, True]
        counts[queues.CHECKS, False] = max(0, waiting)
        shown = (*ROLES, queues.CHECKS)
        return [QueueRecord(role=q, queued=counts[q, False], running=counts[q, True]) for q in shown]

    def executors(self) -> builtins.list[ExecutorRecord]:
        """Processes that run work, and those that did lately."""
        with self._database.read() as connection:
            rows = self._executors(connection)
        return [
            ExecutorRecord(
                id=row.id,
                host=row.host.partition("/")[0],
                roles=tuple(part.partition(":")[0] for part in row.roles.split(",")),
                last_seen=iso(row.last_seen),
                alive=row.age <= self._settings.ttl,
            )
            for row in rows
        ]

    def check_next(self, scene_id: str) -> None:
        """Has workers check what the key that sent a scene has waiting; see `services.engine.checks`."""

        def body(connection: sa.Connection) -> None:
            sender = sa.select(tables.scenes.c.created_by).where(tables.scenes.c.id == scene_id)
            key = connection.scalar(sender)
            if key is not None:
                checks.queue_next(connection, self._database, self.client, key, self._settings.checks_per_key)

        self._database.retry(body)

    def check_longer(self, workflow_id: str) -> None:
        """Queues a check whose turn is over among the long ones; see `services.engine.checks`."""
        self._database.retry(lambda c: checks.queue_long(c, self._database, self.client, workflow_id))

    def _enqueue(self, connection: sa.Connection, job_id: str, attempt: int, spec: JobSpec) -> None:
        system.enqueue(
            self.client,
            connection,
            "job",
            states.workflow_of(job_id, attempt),
            "jobs",
            *(job_id, attempt),
            priority=queues.job_priority(spec.priority),
        )

    def _known(self, connection: sa.Connection, job_id: str) -> None:
        if connection.scalar(sa.select(tables.jobs.c.id).where(tables.jobs.c.id == job_id)) is None:
            raise _unknown(job_id)

    def _executors(self, connection: sa.Connection) -> Sequence[sa.Row[Any]]:
        table = tables.executors
        age = (clock(self._database) - table.c.last_seen).label("age")
        return connection.execute(sa.select(table, age).order_by(table.c.id)).all()

    def _records(self, connection: sa.Connection, rows: Sequence[sa.Row[Any]]) -> builtins.list[JobRecord]:
        slots: Counter[str] = Counter()
        for executor in self._executors(connection):
            if executor.age <= self._settings.ttl:
                for part in executor.roles.split(","):
                    role, _, count = part.partition(":")
                    slots[role] += int(count or 1)
        wholes = progress.measure(connection, rows, slots)
        return [_job_record(row, wholes[row.id]) for row in rows]


_SELECT = sa.select(tables.jobs)


def _digest(spec: JobSpec) -> str:
    """What tells whether two requests are the same: one from before a field was added still is, by its default."""
    return hashlib.sha256(canonical_json(spec.model_dump(mode="json", exclude_defaults=True)).encode()).hexdigest()


def _of_key(connection: sa.Connection, submitted_by: str, key: str | None) -> sa.Row[Any] | None:
    if key is None:
        return None
    table = tables.jobs
    return connection.execute(  # type: ignore[return-value]
        sa.select(table.c.id, table.c.idempotency_digest).where(
            table.c.submitted_by == submitted_by, table.c.idempotency_key == key
        )
    ).first()


def _same(earlier: sa.Row[Any], digest: str) -> str:
    if earlier.idempotency_digest != digest:
        raise Problem(
            f"The idempotency key came with another job before: {earlier.id}.",
            "Use a new key for a new job.",
            ExitCode.CONFLICT,
        )
    return str(earlier.id)


def _require_place(connection: sa.Connection, submitted_by: str, most: int | None) -> None:
    """Refuses one more job of a key; requests of the key wait for each other, so that all are counted.

    Raises:
        Problem: It has `most` that have not ended.
    """
    if most is None:
        return
    connection.execute(sa.select(tables.keys.c.id).where(tables.keys.c.id == submitted_by).with_for_update())
    mine = sa.and_(tables.jobs.c.submitted_by == submitted_by, tables.jobs.c.state.not_in(FINAL_STATES))
    if int(connection.scalar(sa.select(sa.func.count()).where(mine)) or 0) >= most:
        raise Problem(
            f"The key has {counted(most, 'jobs')} under way, as many as it may.",
            "Wait until some have ended, or cancel them.",
            ExitCode.LIMIT,
        )


def _unknown(job_id: str) -> Problem:
    return Problem(f"There is no job {job_id}.", "List the jobs with `diaphane jobs list`.", ExitCode.NOT_FOUND)


def _job_record(row: sa.Row[Any], whole: progress.Whole) -> JobRecord:
    return JobRecord(
        id=row.id,
        kind=row.kind,
        name=row.name,
        spec=row.spec,
        state=row.state,
        attempt=row.attempt,
        stage=row.stage,
        stages=whole.stages,
        fraction=whole.fraction,
        eta_seconds=whole.eta_seconds,
        priority=row.priority,
        created=iso(row.created),
        started=None if row.started is None else iso(row.started),
        finished=None if row.finished is None else iso(row.finished),
        submitted_by=row.submitted_by,
        request_id=row.request_id,
        problem=row.problem,
        result=row.result,
        skipped=row.skipped,
    )


def _task_record(row: sa.Row[Any]) -> TaskRecord:
    return TaskRecord(
        stage=row.stage,
        name=row.name,
        artifact=row.artifact,
        state=row.state,
        progress=row.progress,
        note=row.note,
        executor=row.executor,
        started=None if row.started is None else iso(row.started),
        finished=None if row.finished is None else iso(row.finished),
        seconds=row.seconds,
        problem=row.problem,
    )
