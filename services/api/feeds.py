"""Events of jobs as they happen, for any number of listeners at the price of one.

Workers write events into the database, any process of them; one task looks there for all jobs that are listened to, a
query for each look. What it finds is formatted once and kept for a while; a listener that is further behind reads
pages of its own until it has caught up.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import sqlalchemy as sa
import structlog
from anyio import to_thread
from sqlalchemy.exc import SQLAlchemyError

from schemas.job import FINAL_STATES
from services.clock import iso
from services.database import Database
from services.database.tables import events, jobs

TICK_SECONDS = 0.25
HEARTBEAT_SECONDS = 15.0

_KEPT = 1000
_PAGE = 500

log = structlog.get_logger("diaphane.feeds")

Numbered = tuple[int, bytes]


@dataclass(eq=False)
class _Feed:
    """What is known of one job.

    Attributes:
        last: Number of its last event.
        final: Whether the job has ended.
        kept: Its last events.
        listeners: How many listen.
        changed: Set when something came; then replaced.
    """

    last: int
    final: bool
    kept: deque[Numbered] = field(default_factory=lambda: deque(maxlen=_KEPT))
    listeners: int = 0
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def after(self, number: int) -> list[Numbered] | None:
        """Events after a number; None if some of them are not kept any more."""
        if number >= self.last:
            return []
        if not self.kept or self.kept[0][0] > number + 1:
            return None
        return [event for event in self.kept if event[0] > number]

    def tell(self) -> None:
        """Wakes all listeners."""
        self.changed.set()
        self.changed = asyncio.Event()


class Feeds:
    """All feeds of a process.

    Args:
        database: Where the events are.
        tick: Seconds between two looks.
        heartbeat: Seconds of silence after which a listener gets a comment, so that no proxy takes it for dead.
    """

    def __init__(self, database: Database, tick: float = TICK_SECONDS, heartbeat: float = HEARTBEAT_SECONDS) -> None:
        self._database, self._tick, self._heartbeat = database, tick, heartbeat
        self._feeds: dict[str, _Feed] = {}
        self._poller: asyncio.Task[None] | None = None
        self._closed = False
        self.looks = 0
        """Queries for news so far."""

    @property
    def listeners(self) -> int:
        """How many listen now."""
        return sum(feed.listeners for feed in self._feeds.values())

    @property
    def closed(self) -> bool:
        """Whether streams have to end."""
        return self._closed

    def close(self) -> None:
        """Ends all streams, now and from now on."""
        self._closed = True
        for feed in self._feeds.values():
            feed.tell()

    def state(self, job_id: str) -> tuple[int, bool] | None:
        """Number of the last event of a job, and whether it has ended; None if there is no such job."""
        return self._states([job_id]).get(job_id)

    async def listen(self, job_id: str, after: int, state: tuple[int, bool]) -> AsyncIterator[bytes]:
        """The events of a job after a number, in the form of server-sent events, until it has ended.

        Args:
            job_id: The job.
            after: Number of the last event that the listener has.
            state: Of the job, as `state` tells.
        """
        feed = self._feeds.setdefault(job_id, _Feed(*state))
        feed.listeners += 1
        self._watch()
        try:
            yield b": events of a job\n\n"
            while not self._closed:
                changed = feed.changed  # before looking, so that nothing slips between
                found = feed.after(after)
                if found is None:
                    found = await to_thread.run_sync(self._page, job_id, after)
                    after = after if found else feed.last  # they were removed
                if found:
                    after = found[-1][0]
                    yield b"".join(text for _, text in found)
                    continue
                if feed.final:
                    return
                try:
                    await asyncio.wait_for(changed.wait(), self._heartbeat)
                except TimeoutError:
                    yield b": still here\n\n"
        finally:
            feed.listeners -= 1
            if not feed.listeners and self._feeds.get(job_id) is feed:
                del self._feeds[job_id]

    def _watch(self) -> None:
        if self._poller is None or self._poller.done():
            self._poller = asyncio.get_running_loop().create_task(self._poll())

    async def _poll(self) -> None:
        """Runs while anybody listens."""
        while self._feeds and not self._closed:
            known = {job_id: (feed, feed.last) for job_id, feed in self._feeds.items()}
            try:
                states, news = await to_thread.run_sync(self._look, {job: last for job, (_, last) in known.items()})
            except SQLAlchemyError as error:
                log.warning("events cannot be read", error=type(error).__name__)
                await asyncio.sleep(4.0 * self._tick)
                continue
            for job_id, (feed, _) in known.items():
                self._take(feed, states.get(job_id), news.get(job_id, []))
            await asyncio.sleep(self._tick)

    @staticmethod
    def _take(feed: _Feed, state: tuple[int, bool] | None, news: Sequence[Numbered]) -> None:
        before = (feed.last, feed.final)
        feed.kept.extend(news)
        feed.last = news[-1][0] if news else feed.last
        if state is None:
            feed.final = True  # the job was removed
        else:
            last, final = state
            feed.final = final and feed.last >= last
        if (feed.last, feed.final) != before:
            feed.tell()

    def _look(self, known: dict[str, int]) -> tuple[dict[str, tuple[int, bool]], dict[str, list[Numbered]]]:
        """States of the jobs, and the events after the known ones."""
        self.looks += 1
        states = self._states(list(known))
        behind = [job_id for job_id, (last, _) in states.items() if last > known[job_id]]
        news: dict[str, list[Numbered]] = {}
        if behind:
            places = [sa.and_(events.c.job_id == job_id, events.c.number > known[job_id]) for job_id in behind]
            query = sa.select(events).where(sa.or_(*places)).order_by(events.c.job_id, events.c.number)
            with self._database.read() as connection:
                for row in connection.execute(query.limit(_KEPT)).mappings():
                    news.setdefault(row["job_id"], []).append((row["number"], _format(row)))
        return states, news

    def _states(self, ids: list[str]) -> dict[str, tuple[int, bool]]:
        query = sa.select(jobs.c.id, jobs.c.last_event, jobs.c.state).where(jobs.c.id.in_(ids))
        with self._database.read() as connection:
            return {job_id: (last, state in FINAL_STATES) for job_id, last, state in connection.execute(query)}

    def _page(self, job_id: str, after: int) -> list[Numbered]:
        mine = sa.and_(events.c.job_id == job_id, events.c.number > after)
        query = sa.select(events).where(mine).order_by(events.c.number).limit(_PAGE)
        with self._database.read() as connection:
            return [(row["number"], _format(row)) for row in connection.execute(query).mappings()]


def _format(row: Any) -> bytes:
    """`id`, `event` and `data`; the data is the whole record in one line."""
    record = {"number": row["number"], "at": iso(row["at"]), "kind": row["kind"], "data": row["data"]}
    return f"id: {row['number']}\nevent: {row['kind']}\ndata: {json.dumps(record)}\n\n".encode()
