"""What happened in a job: numbered from 1 without gaps, under the lock of the job's row."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import sqlalchemy as sa

from schemas.service import EventKind, EventRecord
from services.clock import iso
from services.database import tables

Event = tuple[EventKind, dict[str, Any]]


def add(connection: sa.Connection, job_id: str, *events: Event) -> None:
    """Appends events within the caller's transaction."""
    append(connection, job_id, events)


def append(connection: sa.Connection, job_id: str, events: Sequence[Event]) -> None:
    """Appends events within the caller's transaction; does nothing for a job that is gone."""
    if not events:
        return
    counted = (
        tables.jobs.update()
        .where(tables.jobs.c.id == job_id)
        .values(last_event=tables.jobs.c.last_event + len(events))
        .returning(tables.jobs.c.last_event)
    )
    last = connection.scalar(counted)
    if last is None:
        return
    now, first = time.time(), int(last) - len(events) + 1
    rows = [
        {"job_id": job_id, "number": first + index, "at": now, "kind": kind, "data": data}
        for index, (kind, data) in enumerate(events)
    ]
    connection.execute(tables.events.insert(), rows)


def read(connection: sa.Connection, job_id: str, after: int, limit: int) -> list[EventRecord]:
    """The events with numbers beyond `after`, in order."""
    table = tables.events
    found = sa.select(table).where(table.c.job_id == job_id, table.c.number > after).order_by(table.c.number)
    return [
        EventRecord(number=row.number, at=iso(row.at), kind=row.kind, data=row.data)
        for row in connection.execute(found.limit(limit))
    ]
