"""Transitions of tasks, each one transaction, and the workflows that do them.

    queued -> running -> done
       ^         |-> queued        tried again: an error, or something that it needs has to be made again first
       |         +-> quarantined   with the reason; the job goes on without it
       +-> skipped                 the artifact was there
    (whatever is open) -> cancelled

A task's workflows have the ids JOB.ATTEMPT/POSITION/NUMBER; at most one of them waits or runs.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import sqlalchemy as sa

from schemas.problem import Problem
from schemas.service import ProblemDocument
from services.database import Database, tables
from services.engine import events, problems, queues, system
from services.engine.states import PATIENCE_SECONDS, Abandoned, Cancelled, Claim, lock_job, prefix_of, read
from services.problems import document_of
from stages.catalogue import STAGES
from stages.tasks import Task

if TYPE_CHECKING:
    from dbos import DBOSClient

ERRORS = 3
"""A task that failed this often is quarantined."""
ROUNDS = 2
"""How often a task may exhaust its lost executors: a bystander of another task's crashes gets through the second."""
LOST_EXECUTORS = 3
"""Executors that may be lost in one round."""
MOST_WORKFLOWS = 60
"""A task with more tries than that, for whatever reasons, ends."""

_OPEN = ("queued", "running")


@dataclass(frozen=True, slots=True)
class Place:
    """Which task of which job a workflow does."""

    job_id: str
    attempt: int
    position: int

    @property
    def prefix(self) -> str:
        """What the ids of the task's workflows begin with."""
        return f"{prefix_of(self.job_id, self.attempt)}{self.position}/"

    @property
    def row(self) -> sa.ColumnElement[bool]:
        """Its row."""
        return sa.and_(tables.tasks.c.job_id == self.job_id, tables.tasks.c.position == self.position)


@dataclass(frozen=True, slots=True)
class Begun:
    """A task that a worker has begun.

    Attributes:
        task: What to make.
        again: Whether it was begun before.
        owner: Id of the key that submitted the job.
    """

    task: Task
    again: bool
    owner: str


class Tasks:
    """The tasks of all jobs. One that is tried again keeps its turn.

    Args:
        database: The database.
        client: Queues workflows in it.
        retry_seconds: Delay before the second try of a task; before the third it is four times as long.
    """

    def __init__(self, database: Database, client: DBOSClient, retry_seconds: float = 2.0) -> None:
        self._database, self._client, self._retry_seconds = database, client, retry_seconds

    def place(self, claim: Claim, job_id: str, asked: Sequence[tuple[Task, bool]]) -> None:
        """Makes or renews the rows of tasks of one stage, and queues what has to be done.

        Doing it again changes nothing, so a job that goes on in another process does it again.

        Args:
            claim: Of the workflow that conducts the job.
            job_id: The job.
            asked: The tasks, and whether each one's artifact is there.

        Raises:
            Cancelled: The job is being cancelled.
            Abandoned: Another process conducts the job.
        """

        def body(connection: sa.Connection) -> None:
            job = self._running(connection, claim, job_id)
            stage = asked[0][0].stage
            here = [tables.tasks.c.job_id == job_id, tables.tasks.c.stage == stage]
            rows = {row.name: row for row in connection.execute(sa.select(tables.tasks).where(*here))}
            tried = self._tried(connection, job)
            last = connection.scalar(
                sa.select(sa.func.max(tables.tasks.c.position)).where(tables.tasks.c.job_id == job_id)
            )
            position, queued = 0 if last is None else int(last) + 1, []
            for task, held in asked:
                row = rows.get(task.name)
                if row is None:
                    connection.execute(tables.tasks.insert().values(**_values(job_id, position, task, held)))
                    queued += [] if held else [(position, task)]
                    position += 1
                elif self._renew(connection, row, task, held, row.position in tried):
                    queued.append((row.position, task))
            self._enqueue(connection, job, queued, tried)

        self._database.retry(body, PATIENCE_SECONDS)

    def open(self, job_id: str, stage: str) -> int:
        """How many tasks of a stage are not at their end."""
        table = tables.tasks
        counted = sa.select(sa.func.count()).where(
            table.c.job_id == job_id, table.c.stage == stage, table.c.state.in_(_OPEN)
        )
        return int(read(self._database, lambda connection: connection.scalar(counted)) or 0)

    def states(self, job_id: str, stage: str) -> dict[str, str]:
        """State of each task of a stage, by name."""
        found = sa.select(tables.tasks.c.name, tables.tasks.c.state)
        mine = found.where(tables.tasks.c.job_id == job_id, tables.tasks.c.stage == stage)
        return read(self._database, lambda connection: {row.name: row.state for row in connection.execute(mine)})

    def mend(self, claim: Claim, job_id: str) -> None:
        """Sees to open tasks that no workflow does any more: their executors were lost too often.

        Raises:
            Cancelled: The job is being cancelled.
            Abandoned: Another process conducts the job.
        """

        def body(connection: sa.Connection) -> None:
            job = self._running(connection, claim, job_id)
            open_tasks = connection.execute(
                sa.select(tables.tasks).where(tables.tasks.c.job_id == job_id, tables.tasks.c.state.in_(_OPEN))
            ).all()
            prefix = prefix_of(job_id, job.attempt)
            if system.live(connection, self._database, prefix) >= len(open_tasks):
                return
            found: dict[int, list[str]] = defaultdict(list)
            for workflow_id, status in system.statuses(connection, self._database, prefix):
                found[int(workflow_id.split("/")[1])].append(status)
            for row in open_tasks:
                ends = found[row.position]
                if any(status in system.LIVE for status in ends):
                    continue
                rounds = sum(status == system.LOST for status in ends)
                if rounds >= ROUNDS or len(ends) > MOST_WORKFLOWS:
                    self._quarantine(connection, row, problems.lost(max(1, rounds) * LOST_EXECUTORS))
                    continue
                self._requeue(connection, job, row, len(ends), 0, 0.0)

        self._database.retry(body, PATIENCE_SECONDS)

    def begin(self, claim: Claim, place: Place, errors: int = 0) -> Begun | None:
        """A worker begins a task.

        Args:
            claim: Of the workflow that does it.
            place: The task.
            errors: How often it failed before.

        Returns:
            The task; None if it is at its end, or another job makes the same now: then it is tried again later.

        Raises:
            Abandoned: The claim was lost.
        """

        def body(connection: sa.Connection) -> Begun | None:
            job = lock_job(connection, place.job_id)
            claim.check(connection, self._database)
            row = connection.execute(sa.select(tables.tasks).where(place.row)).first()
            if job is None or job.state != "running" or row is None or row.state not in _OPEN:
                return None
            if self._made_elsewhere(connection, row):
                tried = self._tries(connection, place)
                self._requeue(connection, job, row, tried, errors, min(60.0, 0.5 * tried))
                return None
            values = {"state": "running", "executor": claim.executor, "started": time.time(), "finished": None}
            connection.execute(tables.tasks.update().where(place.row).values(**values, progress=None, note=None))
            events.add(connection, place.job_id, ("task", _event(row, "running", executor=claim.executor)))
            return Begun(Task.model_validate(row.task), row.started is not None, job.submitted_by)

        return self._database.retry(body, PATIENCE_SECONDS)

    def report(self, claim: Claim, place: Place, values: Mapping[str, Any], found: Sequence[events.Event]) -> None:
        """Writes how far a task is and what it said. It tries once: the next report says more.

        Raises:
            Abandoned: The claim was lost.
        """
        with self._database.write() as connection:
            if found:
                lock_job(connection, place.job_id)
            claim.check(connection, self._database)
            if values:
                connection.execute(tables.tasks.update().where(place.row).values(**values))
            events.append(connection, place.job_id, found)

    def end(self, claim: Claim, place: Place, state: str, note: str | None, found: Sequence[events.Event] = ()) -> None:
        """A task's artifact is there: it was made (`done`) or found (`skipped`).

        Raises:
            Abandoned: The claim was lost.
        """

        def body(connection: sa.Connection) -> None:
            row = self._mine(connection, claim, place)
            now = time.time()
            values = {"state": state, "finished": now, "seconds": now - row.started, "progress": 1.0, "note": note}
            connection.execute(tables.tasks.update().where(place.row).values(**values, problem=None))
            ended = _event(row, state, seconds=round(now - row.started, 3), note=note)
            events.append(connection, place.job_id, [*found, ("task", ended)])

        self._database.retry(body, PATIENCE_SECONDS)

    def fail(
        self,
        claim: Claim,
        place: Place,
        problem: Problem,
        errors: int,
        found: Sequence[events.Event] = (),
        *,
        final: bool,
        crashed: bool = False,
    ) -> None:
        """A task failed: it is queued again, or quarantined.

        After a first crash it is not delayed: in the meantime its worker would begin another one, which may be long.

        Args:
            claim: Of the workflow that did it.
            place: The task.
            problem: Why it failed.
            errors: How often it failed before.
            found: Events that come first.
            final: Whether another try would end the same way.
            crashed: Whether its process ended, rather than its body.

        Raises:
            Abandoned: The claim was lost.
        """

        def body(connection: sa.Connection) -> None:
            row = self._mine(connection, claim, place)
            events.append(connection, place.job_id, found)
            document = document_of(problem)
            if final or errors + 1 >= ERRORS:
                self._quarantine(connection, row, document)
                return
            again = _event(row, "queued", problem=document.model_dump(mode="json"))
            waits = errors - 1 if crashed else errors
            delay = self._retry_seconds * 4.0**waits if waits >= 0 else 0.0
            self._repeat(connection, place, row, errors + 1, delay, again)

        self._database.retry(body, PATIENCE_SECONDS)

    def wait_for(self, claim: Claim, place: Place, artifact: str, errors: int) -> None:
        """Something that a task needs is gone: it is made again, and the task is repeated.

        Raises:
            Abandoned: The claim was lost.
        """

        def body(connection: sa.Connection) -> None:
            row = self._mine(connection, claim, place)
            problem = self._remake(connection, lock_job(connection, place.job_id), artifact)
            if problem is not None:
                self._quarantine(connection, row, document_of(problem))
                return
            tried = self._tries(connection, place)
            waiting = _event(row, "queued", note=f"waits for {artifact}, which is made again")
            self._repeat(connection, place, row, errors, min(10.0, 0.5 * tried), waiting)

        self._database.retry(body, PATIENCE_SECONDS)

    def remake(self, claim: Claim, job_id: str, artifact: str) -> None:
        """Makes an artifact again that the job found to be gone.

        Raises:
            Problem: Nothing tells how to make it.
            Cancelled: The job is being cancelled.
            Abandoned: Another process conducts the job.
        """

        def body(connection: sa.Connection) -> Problem | None:
            return self._remake(connection, self._running(connection, claim, job_id), artifact)

        problem = self._database.retry(body, PATIENCE_SECONDS)
        if problem is not None:
            raise problem

    def _running(self, connection: sa.Connection, claim: Claim, job_id: str) -> sa.Row[Any]:
        job = lock_job(connection, job_id)
        claim.check(connection, self._database)
        if job is None or job.state != "running":
            raise Cancelled(job_id)
        return job

    def _mine(self, connection: sa.Connection, claim: Claim, place: Place) -> sa.Row[Any]:
        lock_job(connection, place.job_id)
        claim.check(connection, self._database)
        row = connection.execute(sa.select(tables.tasks).where(place.row)).first()
        if row is None or row.state != "running":
            raise Abandoned(claim.workflow_id)
        return row

    def _tried(self, connection: sa.Connection, job: sa.Row[Any]) -> Counter[int]:
        """How many workflows each position has had."""
        found = system.statuses(connection, self._database, prefix_of(job.id, job.attempt))
        return Counter(int(workflow_id.split("/")[1]) for workflow_id, _ in found)

    def _renew(self, connection: sa.Connection, row: sa.Row[Any], task: Task, held: bool, tried: bool) -> bool:
        """Fits a row of an earlier run or attempt to what is asked now; whether the task has to be queued."""
        if row.artifact == task.artifact:
            if row.state == "quarantined" or (row.state in _OPEN and tried):
                return False
            if row.state in ("done", "skipped") and held:
                return False
        values = _values(row.job_id, row.position, task, held)
        connection.execute(
            tables.tasks.update()
            .where(tables.tasks.c.job_id == row.job_id, tables.tasks.c.position == row.position)
            .values(**values)
        )
        return not held

    def _remake(self, connection: sa.Connection, job: sa.Row[Any] | None, artifact: str) -> Problem | None:
        if job is None:
            return problems.unmade(artifact)
        table = tables.tasks
        rows = connection.execute(sa.select(table).where(table.c.artifact == artifact)).all()
        own = next((row for row in rows if row.job_id == job.id), None)
        if own is None and not rows:
            return problems.unmade(artifact)
        if own is not None and own.state in _OPEN:
            return None
        if own is not None and own.state == "quarantined":
            document = ProblemDocument.model_validate(own.problem)
            return Problem(f"{own.stage} {own.name}, which it needs, failed: {document.detail}", document.remedy)
        task = Task.model_validate((own or rows[0]).task)
        if own is None:  # another job made it: this one makes it again as a task of its own
            last = connection.scalar(sa.select(sa.func.max(table.c.position)).where(table.c.job_id == job.id))
            position = int(last or 0) + 1
            task = task.model_copy(update={"name": f"{task.name} {artifact[-8:]}"})
            connection.execute(table.insert().values(**_values(job.id, position, task, held=False)))
        else:
            position = own.position
            self._back(connection, own)
        self._enqueue(connection, job, [(position, task)], self._tried(connection, job))
        return None

    def _repeat(
        self,
        connection: sa.Connection,
        place: Place,
        row: sa.Row[Any],
        errors: int,
        delay: float,
        event: dict[str, Any],
    ) -> None:
        job = lock_job(connection, place.job_id)
        if job is None or job.state != "running":
            raise Abandoned(place.prefix)
        events.add(connection, place.job_id, ("task", event))
        self._requeue(connection, job, row, self._tries(connection, place), errors, delay)

    def _requeue(
        self, connection: sa.Connection, job: sa.Row[Any], row: sa.Row[Any], tried: int, errors: int, delay: float
    ) -> None:
        self._back(connection, row)
        task = Task.model_validate(row.task)
        self._enqueue(connection, job, [(row.position, task)], Counter({row.position: tried}), errors, delay)

    def _tries(self, connection: sa.Connection, place: Place) -> int:
        """How many workflows a task has had."""
        return len(system.statuses(connection, self._database, place.prefix))

    def _made_elsewhere(self, connection: sa.Connection, row: sa.Row[Any]) -> bool:
        """Whether a task of another job makes the same artifact now."""
        table = tables.tasks
        same = [table.c.artifact == row.artifact, table.c.state == "running", table.c.job_id != row.job_id]
        return connection.execute(sa.select(table.c.name).where(*same).limit(1)).first() is not None

    def _enqueue(
        self,
        connection: sa.Connection,
        job: sa.Row[Any],
        queued: Sequence[tuple[int, Task]],
        tried: Counter[int],
        errors: int = 0,
        delay: float = 0.0,
    ) -> None:
        prefix, numbers = prefix_of(job.id, job.attempt), dict[str, int]()
        for position, task in queued:
            role = STAGES[task.stage].role
            kept = (
                system.first_priority(connection, self._database, f"{prefix}{position}/") if tried[position] else None
            )
            if kept is None and role not in numbers:
                numbers[role] = queues.next_priority(connection, self._database, role, job.priority, prefix)
            system.enqueue(
                self._client,
                connection,
                "task",
                f"{prefix}{position}/{tried[position]}",
                role,
                *(job.id, job.attempt, position, errors),
                priority=numbers[role] if kept is None else kept,
                delay=delay,
            )
            if kept is None:
                numbers[role] += 1

    def _back(self, connection: sa.Connection, row: sa.Row[Any]) -> None:
        values = {"state": "queued", "executor": None, "progress": None, "finished": None, "problem": None}
        here = [tables.tasks.c.job_id == row.job_id, tables.tasks.c.position == row.position]
        connection.execute(tables.tasks.update().where(*here).values(**values))

    def first_problem(self, job_id: str, stage: str) -> ProblemDocument:
        """Why a task of a stage was quarantined, the first of them."""
        table = tables.tasks
        here = [table.c.job_id == job_id, table.c.stage == stage, table.c.state == "quarantined"]
        query = sa.select(table.c.problem).where(*here).order_by(table.c.position).limit(1)
        with self._database.read() as connection:
            return ProblemDocument.model_validate(connection.scalar(query))

    def _quarantine(self, connection: sa.Connection, row: sa.Row[Any], problem: ProblemDocument) -> None:
        document = problem.model_dump(mode="json")
        here = [tables.tasks.c.job_id == row.job_id, tables.tasks.c.position == row.position]
        values = {"state": "quarantined", "finished": time.time(), "problem": document}
        connection.execute(tables.tasks.update().where(*here).values(**values))
        events.add(connection, row.job_id, ("task", _event(row, "quarantined", problem=document)))


def _values(job_id: str, position: int, task: Task, held: bool) -> dict[str, Any]:
    return {
        "job_id": job_id,
        "stage": task.stage,
        "name": task.name,
        "position": position,
        "artifact": task.artifact,
        "task": task.model_dump(mode="json"),
        "state": "skipped" if held else "queued",
        **dict.fromkeys(("executor", "note", "started", "finished", "seconds", "problem")),
        "progress": 1.0 if held else None,
    }


def _event(row: sa.Row[Any], state: str, **more: Any) -> dict[str, Any]:
    told = {key: value for key, value in more.items() if value is not None}
    return {"stage": row.stage, "name": row.name, "artifact": row.artifact, "state": state, **told}
