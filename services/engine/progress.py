"""How far jobs are, and for how long still: from the states of their tasks, for any number of jobs in one query."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from schemas.job import JobKind
from schemas.service import StageProgress
from services.database import tables
from stages.catalogue import STAGES
from stages.tasks import StageName

STAGES_OF: Mapping[JobKind, tuple[StageName, ...]] = {
    "render": ("scene", "render"),
    "label": ("scene", "render", "label"),
    "train": ("scene", "render", "label", "train", "export"),
    "evaluate": ("scene", "render", "label", "evaluate"),
    "build": tuple(STAGES),
}
"""The stages of each kind of job, in order."""
WITHOUT_SCENES: tuple[StageName, ...] = ("train", "export")
"""Those of a job that trains on a data set."""


@dataclass(frozen=True, slots=True)
class Whole:
    """Progress of a job.

    Attributes:
        stages: Of each stage begun, in order.
        fraction: Of the whole, in [0, 1].
        eta_seconds: Seconds still to go; None while nothing is known.
    """

    stages: tuple[StageProgress, ...] = ()
    fraction: float = 0.0
    eta_seconds: float | None = None


def measure(connection: sa.Connection, jobs: Sequence[sa.Row[Any]], slots: Mapping[str, int]) -> dict[str, Whole]:
    """Progress of jobs by id.

    Args:
        connection: For reading.
        jobs: Rows of the jobs.
        slots: How many tasks of each role the living workers do at once.
    """
    table, now = tables.tasks, time.time()
    # A task under way counts as far as it says that it is, and its time from its beginning.
    query = (
        sa.select(
            table.c.job_id,
            table.c.stage,
            table.c.state,
            sa.func.count().label("number"),
            sa.func.min(table.c.position).label("first"),
            sa.func.sum(sa.func.coalesce(table.c.progress, 0.0)).label("progress"),
            sa.func.avg(table.c.seconds).label("seconds"),
            sa.func.min(table.c.started).label("started"),
        )
        .where(table.c.job_id.in_([row.id for row in jobs]))
        .group_by(table.c.job_id, table.c.stage, table.c.state)
    )
    found: dict[str, dict[str, dict[str, sa.Row[Any]]]] = defaultdict(lambda: defaultdict(dict))
    for group in connection.execute(query):
        found[group.job_id][group.stage][group.state] = group
    return {row.id: _whole(row, found[row.id], slots, now) for row in jobs}


def _whole(
    job: sa.Row[Any], groups: Mapping[str, Mapping[str, sa.Row[Any]]], slots: Mapping[str, int], now: float
) -> Whole:
    order = sorted(groups, key=lambda name: min(group.first for group in groups[name].values()))
    stages = tuple(_stage(name, groups[name], slots.get(_role(name), 0), now) for name in order)
    if job.state == "succeeded":
        return Whole(stages, 1.0, None)
    known = {stage.stage: stage.fraction for stage in stages}
    names = STAGES_OF[job.kind] if job.spec.get("dataset") is None else WITHOUT_SCENES
    shares = {name: STAGES[name].share for name in names}
    whole = sum(shares.values())
    fraction = sum(share * known.get(name, 0.0) for name, share in shares.items()) / whole
    if job.state != "running":
        return Whole(stages, round(fraction, 4), None)
    return Whole(stages, round(min(fraction, 0.999), 4), _eta(job, stages, fraction, now))


def _role(name: str) -> str:
    return next((stage.role for stage in STAGES.values() if stage.name == name), "")


def _stage(name: str, groups: Mapping[str, sa.Row[Any]], slots: int, now: float) -> StageProgress:
    counts = {state: int(group.number) for state, group in groups.items()}
    total = sum(counts.values())
    running = groups.get("running")
    partly = float(running.progress) if running is not None else 0.0
    ended = sum(counts.get(state, 0) for state in ("done", "skipped", "quarantined", "cancelled"))
    done, eta = groups.get("done"), None
    left = counts.get("queued", 0) + counts.get("running", 0) - partly
    if total == ended:
        eta = 0.0
    elif done is not None and done.seconds is not None:
        eta = left * float(done.seconds) / max(1, min(slots or 1, counts.get("queued", 0) + counts.get("running", 0)))
    elif running is not None and partly > 0.02 and running.started is not None:
        eta = (now - float(running.started)) * left / partly
    return StageProgress(
        stage=name,
        total=total,
        done=counts.get("done", 0),
        skipped=counts.get("skipped", 0),
        running=counts.get("running", 0),
        queued=counts.get("queued", 0),
        quarantined=counts.get("quarantined", 0),
        fraction=round((ended + partly) / total, 4) if total else 0.0,
        eta_seconds=None if eta is None else round(eta, 1),
    )


def _eta(job: sa.Row[Any], stages: Sequence[StageProgress], fraction: float, now: float) -> float | None:
    """The stages under way as their tasks tell; what comes after them in proportion to the time so far."""
    under_way = [stage.eta_seconds for stage in stages if stage.eta_seconds is not None]
    rest = (now - job.started) * (1.0 - fraction) / fraction if fraction > 0.02 and job.started else None
    known = [*under_way, *([] if rest is None else [rest])]
    return round(max(known), 1) if known and max(known) > 0.0 else None
