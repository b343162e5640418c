"""Moves of aliases: how their history tells what came before, and the one transaction that moves one."""

from __future__ import annotations

import getpass
import hashlib
from collections.abc import Sequence
from typing import Any

import sqlalchemy as sa

from schemas.problem import ExitCode, Problem
from schemas.service import MoveRecord
from services.clock import iso
from services.database import Database
from services.database.tables import aliases, moves
from services.registry.pointers import next_move
from services.registry.records import CHAMPION
from services.webhooks import outbox


def local_user() -> str:
    """Who runs this process; `unknown` where the system has no name for them, as in some containers."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "unknown"


def lock_name(connection: sa.Connection, name: str) -> None:
    """Makes the transaction the only one that publishes under a name or moves its aliases, until it ends.

    In SQLite every transaction that writes is alone anyway.
    """
    if connection.dialect.name == "postgresql":
        number = int.from_bytes(hashlib.sha256(f"registry {name}".encode()).digest()[:8], "big", signed=True)
        connection.execute(sa.text("select pg_advisory_xact_lock(:number)"), {"number": number})


def move(database: Database, name: str, change: MoveRecord, *, only_from_before: bool = False) -> None:
    """Points an alias at `change.after` and writes the move down, unless it points there already.

    Args:
        database: Where the aliases are.
        name: Name of the bundle.
        change: The move; its `at` is set here, and its `before` too unless `only_from_before`.
        only_from_before: Move the alias only if it still points at `change.before`.

    Raises:
        Problem: Another process moved the alias meanwhile (CONFLICT).
    """

    def body(connection: sa.Connection) -> None:
        lock_name(connection, name)
        where = (aliases.c.name == name) & (aliases.c.alias == change.alias)
        now = connection.scalar(sa.select(aliases.c.version).where(where))
        if now == change.after:
            return
        if only_from_before and now != change.before:
            raise Problem(
                f"The alias '{change.alias}' of '{name}' was moved to {now} meanwhile.",
                f"Look at `diaphane models show {name}`, and repeat it if it is still right.",
                ExitCode.CONFLICT,
            )
        if now is None:
            connection.execute(aliases.insert().values(name=name, alias=change.alias, version=change.after))
        else:
            connection.execute(aliases.update().where(where).values(version=change.after))
        values: dict[str, Any] = {"before": now, "after": change.after, "who": change.who, "why": change.why}
        values["at"] = next_move(connection, name, change.alias)
        connection.execute(moves.insert().values(name=name, alias=change.alias, **values))
        if change.alias == CHAMPION:
            outbox.champion_moved(connection, name, change, now)

    database.retry(body)


def history(database: Database, name: str) -> list[MoveRecord]:
    """All moves of a name's aliases, oldest first."""
    with database.read() as connection:
        rows = connection.execute(sa.select(moves).where(moves.c.name == name).order_by(moves.c.id)).all()
    return [
        MoveRecord(alias=row.alias, before=row.before, after=row.after, at=iso(row.at), who=row.who, why=row.why)
        for row in rows
    ]


def previous(records: Sequence[MoveRecord], alias: str) -> str | None:
    """The version that an alias meant before its present one; None if there was none.

    A move back to the version before takes the later one off the pile, so that rolling back twice goes back twice, and
    not forth again.
    """
    pile: list[str] = []
    for record in records:
        if record.alias != alias:
            continue
        if len(pile) > 1 and pile[-2] == record.after:
            pile.pop()
        else:
            pile.append(record.after)
    return pile[-2] if len(pile) > 1 else None
