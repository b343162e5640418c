"""Exact places of records in their lists: a record's time is rounded, a cursor's must not be."""

from __future__ import annotations

from datetime import datetime

import sqlalchemy as sa

from services.database import Database, tables


def moment(database: Database, table: sa.Table, record_id: str, shown: str) -> list[float | str]:
    """Time and id of a record.

    Args:
        database: Where it is.
        table: With columns `id` and `created`.
        record_id: Its id.
        shown: Its time as shown, should the record have been removed meanwhile.
    """
    with database.read() as connection:
        created = connection.scalar(sa.select(table.c.created).where(table.c.id == record_id))
    return [created if created is not None else datetime.fromisoformat(shown).timestamp(), record_id]


def position(database: Database, job_id: str, stage: str, name: str) -> list[str | int]:
    """Stage and position of a task in its job."""
    columns = tables.tasks.c
    mine = sa.and_(columns.job_id == job_id, columns.stage == stage, columns.name == name)
    with database.read() as connection:
        return [stage, int(connection.scalar(sa.select(columns.position).where(mine)) or 0)]
