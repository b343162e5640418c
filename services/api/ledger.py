"""Levels of token buckets in the database: what the processes of a service settle their allowances through."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects import postgresql, sqlite

from services.database import Database
from services.database.clock import clock
from services.database.tables import allowances as table

FORGET_SECONDS = 600.0
"""Between two removals of buckets that are full again."""

_PATIENCE_SECONDS = 1.0


class Ledger:
    """Levels of buckets of one kind.

    Args:
        database: Where they are.
        kind: Of the buckets: all of a kind have the same rate and burst.
    """

    def __init__(self, database: Database, kind: str) -> None:
        self._database, self._kind = database, kind
        self._forgotten = time.monotonic()
        self._lock = threading.Lock()

    def level(self, name: str, rate: float, burst: int) -> float:
        """Tokens in a bucket; less than none where it was overdrawn."""
        mine = (table.c.kind == self._kind) & (table.c.name == name)
        with self._database.read() as connection:
            found = connection.scalar(sa.select(self._refilled(rate, burst)).where(mine))
        return float(burst) if found is None else float(found)

    def settle(self, taken: Mapping[str, float], rate: float, burst: int) -> dict[str, float]:
        """Takes tokens that were handed out already; the levels after that."""
        insert = postgresql.insert if self._database.is_postgresql else sqlite.insert
        now = clock(self._database)

        def body(connection: sa.Connection) -> dict[str, float]:
            found = {}
            for name in sorted(taken):  # in one order, so that no two processes wait for each other
                row = {"kind": self._kind, "name": name, "level": burst - taken[name], "at": now}
                less = {"level": self._refilled(rate, burst) - taken[name], "at": now}
                written = insert(table).values(**row).on_conflict_do_update(index_elements=["kind", "name"], set_=less)
                found[name] = float(connection.execute(written.returning(table.c.level)).scalar_one())
            if self._due():
                full = self._refilled(rate, burst) >= burst
                connection.execute(table.delete().where((table.c.kind == self._kind) & full))
            return found

        return self._database.retry(body, _PATIENCE_SECONDS)

    def _refilled(self, rate: float, burst: int) -> sa.ColumnElement[Any]:
        level = table.c.level + (clock(self._database) - table.c.at) * rate
        return (sa.func.least if self._database.is_postgresql else sa.func.min)(level, float(burst))

    def _due(self) -> bool:
        with self._lock:
            due = time.monotonic() - self._forgotten > FORGET_SECONDS
            if due:
                self._forgotten = time.monotonic()
            return due
