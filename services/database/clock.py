"""The database's clock: the one that all processes share."""

from __future__ import annotations

import sqlalchemy as sa

from services.database.connection import Database


def clock(database: Database) -> sa.ColumnElement[float]:
    """The database's clock, seconds since 1970."""
    if database.is_postgresql:
        return sa.literal_column("extract(epoch from clock_timestamp())::double precision")
    return sa.literal_column("((julianday('now') - 2440587.5) * 86400.0)")
