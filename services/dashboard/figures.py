"""What the overview counts, in queries of bounded size."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import sqlalchemy as sa

from schemas.job import FINAL_STATES, JobKind, JobSpec, JobState
from schemas.service import ExecutorRecord, QueueRecord
from services.clock import iso
from services.database import Database
from services.database.tables import aliases, jobs, moves, tasks, versions
from services.registry.records import CHAMPION

JOBS_COUNTED = 200
"""The latest jobs, of which what was skipped is counted."""


@dataclass(frozen=True, slots=True)
class Champion:
    """What the alias `champion` of a name means, and since when and why."""

    name: str
    version: str
    score: float | None
    since: str | None
    why: str


@dataclass(frozen=True, slots=True)
class Ended:
    """A job that has ended, as far as a line tells of it."""

    id: str
    kind: JobKind
    name: str | None
    spec: JobSpec
    state: JobState
    finished: str


@dataclass(frozen=True, slots=True)
class RoleLoad:
    """What waits for a role, and how many processes do its work."""

    role: str
    queued: int
    running: int
    workers: int


@dataclass(frozen=True, slots=True)
class StageSavings:
    """Tasks of a stage that were not done because their artifact was there.

    Attributes:
        stage: The stage.
        tasks: How many.
        timed: For how many of them it is known how long it took to make the artifact.
        seconds: How long those took, together.
    """

    stage: str
    tasks: int
    timed: int
    seconds: float


@dataclass(frozen=True, slots=True)
class Savings:
    """What the latest jobs did not have to do.

    Attributes:
        jobs: How many jobs are counted.
        stages: By stage.
        work: What within the work was left out -> how often.
    """

    jobs: int
    stages: tuple[StageSavings, ...]
    work: dict[str, int]

    @property
    def tasks(self) -> int:
        """Of all stages."""
        return sum(stage.tasks for stage in self.stages)

    @property
    def seconds(self) -> float:
        """Of all stages."""
        return sum(stage.seconds for stage in self.stages)


def champions(database: Database, limit: int, names: Sequence[str] | None = None) -> list[Champion]:
    """The champions that were named last, latest first.

    Args:
        database: Where they are.
        limit: How many at most.
        names: Only those of these names; None: of all.
    """
    latest = (
        sa.select(moves.c.name, sa.func.max(moves.c.id).label("id"))
        .where(moves.c.alias == CHAMPION)
        .group_by(moves.c.name)
        .subquery()
    )
    query = (
        sa.select(aliases.c.name, aliases.c.version, versions.c.score, moves.c.at, moves.c.why)
        .join(versions, (versions.c.name == aliases.c.name) & (versions.c.version == aliases.c.version))
        .outerjoin(latest, latest.c.name == aliases.c.name)
        .outerjoin(moves, moves.c.id == latest.c.id)
        .where(aliases.c.alias == CHAMPION)
        .order_by(moves.c.id.desc(), aliases.c.name)
        .limit(limit)
    )
    if names is not None:
        query = query.where(aliases.c.name.in_(names))
    with database.read() as connection:
        return [
            Champion(row.name, row.version, row.score, iso(row.at) if row.at is not None else None, row.why or "")
            for row in connection.execute(query)
        ]


def under_way(database: Database) -> Counter[str]:
    """How many jobs there are in each state that is not final."""
    query = sa.select(jobs.c.state, sa.func.count().label("number")).where(jobs.c.state.not_in(FINAL_STATES))
    with database.read() as connection:
        return Counter({row.state: row.number for row in connection.execute(query.group_by(jobs.c.state))})


def lately_ended(database: Database, limit: int) -> list[Ended]:
    """The jobs that ended last, whenever they were submitted."""
    columns = jobs.c.id, jobs.c.kind, jobs.c.name, jobs.c.spec, jobs.c.state, jobs.c.finished
    ended = jobs.c.state.in_(FINAL_STATES) & jobs.c.finished.is_not(None)
    latest = jobs.c.finished.desc(), jobs.c.id.desc()
    with database.read() as connection:
        rows = connection.execute(sa.select(*columns).where(ended).order_by(*latest).limit(limit)).all()
    return [
        Ended(row.id, row.kind, row.name, JobSpec.model_validate(row.spec), row.state, iso(row.finished))
        for row in rows
    ]


def role_loads(queues: Sequence[QueueRecord], executors: Sequence[ExecutorRecord]) -> list[RoleLoad]:
    """Queues with the number of living processes beside them."""
    workers = Counter(role for executor in executors if executor.alive for role in executor.roles)
    return [RoleLoad(queue.role, queue.queued, queue.running, workers[queue.role]) for queue in queues]


def savings(database: Database) -> Savings:
    """What the latest jobs found instead of making it: a found artifact saved what it took to make."""
    recent = sa.select(jobs.c.id).order_by(jobs.c.created.desc()).limit(JOBS_COUNTED).subquery()
    found = (tasks.c.state == "skipped") & tasks.c.job_id.in_(sa.select(recent))
    made = (
        sa.select(tasks.c.artifact, sa.func.max(tasks.c.seconds).label("seconds"))
        .where(tasks.c.state == "done", tasks.c.artifact.in_(sa.select(tasks.c.artifact).where(found)))
        .group_by(tasks.c.artifact)
        .subquery()
    )
    by_stage = (
        sa.select(
            tasks.c.stage,
            sa.func.count().label("tasks"),
            sa.func.count(made.c.seconds).label("timed"),
            sa.func.sum(made.c.seconds).label("seconds"),
        )
        .outerjoin(made, made.c.artifact == tasks.c.artifact)
        .where(found)
        .group_by(tasks.c.stage)
        .order_by(sa.func.min(tasks.c.position))
    )
    work: Counter[str] = Counter()
    with database.read() as connection:
        stages = tuple(
            StageSavings(row.stage, row.tasks, row.timed, float(row.seconds or 0.0))
            for row in connection.execute(by_stage)
        )
        counted = list(connection.scalars(sa.select(jobs.c.skipped).where(jobs.c.id.in_(sa.select(recent)))))
    for one in counted:
        work.update(one)
    return Savings(len(counted), stages, dict(work.most_common(10)))
