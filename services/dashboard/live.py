"""Streams that tell a page that something has changed; the page then fetches that part of itself anew."""

from __future__ import annotations

import asyncio
import hashlib
import threading
import time
from collections.abc import AsyncIterator

import sqlalchemy as sa
import structlog
from anyio import to_thread
from sqlalchemy.exc import SQLAlchemyError

from schemas.job import FINAL_STATES
from services.api.feeds import HEARTBEAT_SECONDS, Feeds
from services.database.tables import jobs, tasks
from services.service import Service

LOOK_SECONDS = 1.0
"""Between two looks into the database, however many listen."""

log = structlog.get_logger("diaphane.dashboard")


class Watch:
    """Tells when the jobs under way or the workers change.

    Args:
        service: What is watched.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self._lock = threading.Lock()
        self._seen: tuple[float, str] = (float("-inf"), "")

    def look(self) -> str:
        """What differs when anything of interest has changed; a query at most once a second."""
        with self._lock:
            if time.monotonic() - self._seen[0] > LOOK_SECONDS / 2.0:
                self._seen = (time.monotonic(), self._look())
            return self._seen[1]

    async def changes(self, seen: str, feeds: Feeds) -> AsyncIterator[bytes]:
        """An event for each change, until the server stops.

        Args:
            seen: What `look` said when the page was made.
            feeds: Know when the server stops.
        """
        spoken = time.monotonic()
        yield b": changes\n\n"
        while not feeds.closed:
            try:
                now = await to_thread.run_sync(self.look)
            except SQLAlchemyError as error:
                log.warning("changes cannot be read", error=type(error).__name__)
                now = seen
            if now != seen:
                seen, spoken = now, time.monotonic()
                yield b"event: change\ndata: {}\n\n"
            elif time.monotonic() - spoken > HEARTBEAT_SECONDS:
                spoken = time.monotonic()
                yield b": still here\n\n"
            await asyncio.sleep(LOOK_SECONDS)

    def _look(self) -> str:
        live = jobs.c.state.not_in(FINAL_STATES)
        states = sa.select(jobs.c.state, sa.func.count(), sa.func.sum(jobs.c.last_event)).where(live)
        moving = (tasks.c.state == "running") & tasks.c.job_id.in_(sa.select(jobs.c.id).where(live))
        with self._service.database.read() as connection:
            found = [tuple(row) for row in connection.execute(states.group_by(jobs.c.state))]
            far = connection.scalar(sa.select(sa.func.sum(tasks.c.progress)).where(moving))
        alive = [executor.id for executor in self._service.jobs.executors() if executor.alive]
        return hashlib.sha256(repr((sorted(found), far, sorted(alive))).encode()).hexdigest()[:16]
