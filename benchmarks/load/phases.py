"""All clients at the same time on one service, in processes of their own."""

from __future__ import annotations

import asyncio
import multiprocessing
import time
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import sqlalchemy as sa

from benchmarks.load import traffic
from benchmarks.load.figures import Tally
from benchmarks.load.http import Connection
from benchmarks.load.seed import Seed
from services.database import Database, open_database
from services.engine import events
from services.engine.jobs import Jobs
from services.settings import Settings

T = TypeVar("T")

EVENT_SECONDS = 0.1
"""Between two transactions that write events."""
GRACE_SECONDS = 30.0
"""After the end, until every event stream has ended too."""


@dataclass(frozen=True)
class Plan:
    """A phase.

    Attributes:
        seconds: How long the readers read.
        jobs: How many jobs are submitted.
        per_second: How many of them a second.
        listeners: How many listen to events.
        followed: To how many jobs.
        events_per_second: Written for each followed job, where no worker does.
        mix: The readers.
    """

    seconds: float
    jobs: int
    per_second: float
    listeners: int
    followed: int
    events_per_second: float
    mix: traffic.Mix


def run_queued(
    port: int, seed: Seed, plan: Plan, settings: Settings, pool: Executor | None = None
) -> tuple[Tally, dict[str, Any]]:
    """Jobs stay queued; events are written as workers write them. What happened, and counts.

    Args:
        port: Of the service.
        seed: What it holds.
        plan: What is done.
        settings: Of the service: the events are written into its database.
        pool: Where the clients run, three at once; None: in processes of their own.
    """
    followed = asyncio.run(_submit_first(port, seed, plan.followed))
    with pool or ProcessPoolExecutor(3, multiprocessing.get_context("spawn")) as clients:
        reads = clients.submit(run, traffic.read_all, port, seed, plan.mix, plan.seconds)
        others = clients.submit(run, _submit_and_listen, port, seed, plan, followed)
        writes = clients.submit(write_events, settings, followed, plan.seconds, plan.events_per_second)
        return _collect(port, seed, plan, reads, others, writes)


def write_events(settings: Settings, jobs: Sequence[str], seconds: float, per_second: float) -> Tally:
    """Writes events of jobs in small transactions, in turn, then cancels the jobs."""
    tally, database = Tally(), open_database(settings.database_url)
    service = Jobs(settings, database)
    each = max(1, round(len(jobs) * per_second * EVENT_SECONDS))
    begun, written, turn = time.perf_counter(), 0, 0
    try:
        while (now := time.perf_counter()) < begun + seconds:
            chosen = [jobs[(written + index) % len(jobs)] for index in range(each)]
            database.retry(partial(_append, jobs=chosen, turn=turn))
            tally.took("write events", time.perf_counter() - now)
            written, turn = written + each, turn + 1
            time.sleep(max(0.0, begun + turn * EVENT_SECONDS - time.perf_counter()))
        for job_id in jobs:
            service.cancel(job_id)
    finally:
        service.close()
        database.close()
    return tally


def run(body: Callable[..., Coroutine[Any, Any, T]], *arguments: Any) -> T:
    """Runs a coroutine on uvloop: the clients take as little of the processor as they can."""
    import uvloop

    return uvloop.run(body(*arguments))


def database_bytes(database: Database) -> int:
    """Size of the database."""
    query = "select page_count * page_size from pragma_page_count(), pragma_page_size()"
    if database.is_postgresql:
        query = "select pg_database_size(current_database())"
    with database.read() as connection:
        return int(connection.scalar(sa.text(query)) or 0)


async def _submit_first(port: int, seed: Seed, count: int) -> list[str]:
    tally = Tally()
    found = await traffic.submit_all(port, seed, [seed.spec()] * count, 1e9, tally)
    if tally.errors or len(found) != count:
        raise RuntimeError(f"jobs could not be submitted: {dict(tally.errors)}")
    return found


async def _submit_and_listen(
    port: int, seed: Seed, plan: Plan, followed: Sequence[str]
) -> tuple[Tally, list[str], int]:
    tally = Tally()
    listening = [followed[number % len(followed)] for number in range(plan.listeners)]
    end = time.perf_counter() + plan.seconds + GRACE_SECONDS
    submitted, ended = await asyncio.gather(
        traffic.submit_all(port, seed, [seed.spec()] * plan.jobs, plan.per_second, tally),
        traffic.listen_all(port, seed.key, listening, tally, end),
    )
    return tally, submitted, ended


def _collect(
    port: int,
    seed: Seed,
    plan: Plan,
    reads: Future[Tally],
    others: Future[tuple[Tally, list[str], int]],
    writes: Future[Tally],
) -> tuple[Tally, dict[str, Any]]:
    tally, submitted, ended = others.result()
    for part in (reads.result(), writes.result()):
        tally.add(part)
    queued = asyncio.run(_queued(port, seed))
    missing = set(submitted) - {job["id"] for job in queued}
    if missing or len(set(submitted)) != plan.jobs:
        tally.wrong("submit job", f"{len(missing)} of {len(set(submitted))} jobs are not in the list")
    counts = {"jobs_submitted": len(set(submitted)), "jobs_queued_in_all": len(queued), "streams_ended_well": ended}
    return tally, counts


async def _queued(port: int, seed: Seed) -> list[dict[str, Any]]:
    async with Connection(port, seed.key) as connection:
        return await traffic.pages(connection, "/v1/jobs?state=queued&limit=200")


def _append(connection: sa.Connection, jobs: Sequence[str], turn: int) -> None:
    for job_id in jobs:
        events.add(connection, job_id, ("log", {"text": f"turn {turn} of the load test"}))
