"""API keys: shown once, stored as a hash, revocable at once.

A secret is `dia_<id>_<random>`: the id finds the row, 256 random bits prove it. A hash without salt and stretching is
enough for that: nobody guesses 256 bits.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
import threading
import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import sqlalchemy as sa

from schemas.problem import ExitCode, Problem
from schemas.service import SCOPES, JobBounds, KeyRecord, Scope
from services.clock import iso
from services.database import Database
from services.database.tables import keys as table

_SECRET = re.compile(r"dia_([0-9a-f]{12})_[A-Za-z0-9_-]{43}")
_USED_SECONDS = 60.0
_PATIENCE_SECONDS = 5.0
_NO_DIGEST = "0" * 64
_AS_CONFIGURED = JobBounds()

_CONTAINS: dict[Scope, frozenset[Scope]] = {
    "read": frozenset({"read"}),
    "submit": frozenset({"read", "submit"}),
    "publish": frozenset({"read", "publish"}),
    "admin": frozenset(SCOPES),
}


@dataclass(frozen=True)
class Found:
    """What a secret stands for.

    Attributes:
        key: Its key; None if that is unknown, expired or revoked.
        is_guess: Whether it has the form of a secret, and was nobody's.
    """

    key: KeyRecord | None
    is_guess: bool = False


def allows(key: KeyRecord, scope: Scope) -> bool:
    """Whether a key has a scope, or one that contains it."""
    return any(scope in _CONTAINS[held] for held in key.scopes)


class Keys:
    """The API keys of a service."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._noted: dict[str, float] = {}
        self._lock = threading.Lock()

    def create(
        self, name: str, scopes: Sequence[Scope], expires: float | None = None, bounds: JobBounds = _AS_CONFIGURED
    ) -> tuple[KeyRecord, str]:
        """Makes a key.

        Args:
            name: Who or what it is for.
            scopes: What it may do; at least one.
            expires: Seconds since 1970 after which it is refused.
            bounds: Of its jobs.

        Returns:
            The record, and the secret: it cannot be had again.

        Raises:
            Problem: There is no scope, or one that does not exist, or the key would be expired from the start.
        """
        unknown = sorted(set(scopes) - set(SCOPES))
        if unknown or not scopes:
            wrong = f"There is no scope '{unknown[0]}'." if unknown else "A key needs at least one scope."
            raise Problem(wrong, f"Choose among {', '.join(SCOPES)}.")
        now = time.time()
        if expires is not None and expires <= now:
            raise Problem("The key would be expired from the start.", "Choose a time in the future.")
        identifier = secrets.token_hex(6)
        secret = f"dia_{identifier}_{secrets.token_urlsafe(32)}"
        row = {
            "id": f"key_{identifier}",
            "name": name,
            "digest": _digest(secret),
            "scopes": [scope for scope in SCOPES if scope in scopes],
            "created": now,
            "expires": expires,
            "revoked": None,
            "last_used": None,
            **bounds.model_dump(),
        }

        def insert(connection: sa.Connection) -> None:
            if connection.scalar(sa.select(table.c.id).where(table.c.id == row["id"])) is None:  # else run again
                connection.execute(table.insert().values(**row))

        self._database.retry(insert, _PATIENCE_SECONDS)
        return _record(row), secret

    def authenticate(self, secret: str) -> Found:
        """What a secret stands for."""
        match = _SECRET.fullmatch(secret)
        if match is None:
            return Found(None)
        with self._database.read() as connection:
            row = connection.execute(sa.select(table).where(table.c.id == f"key_{match[1]}")).mappings().first()
        # As long for an unknown id as for a known one.
        same = hmac.compare_digest(_digest(secret), row["digest"] if row else _NO_DIGEST)
        return Found(self._used(row)) if same else Found(None, is_guess=True)

    def alive(self, key_id: str) -> KeyRecord | None:
        """The key of an id, as one that is used now; None if it is unknown, expired or revoked."""
        with self._database.read() as connection:
            return self._used(connection.execute(sa.select(table).where(table.c.id == key_id)).mappings().first())

    def valid(self, ids: Collection[str]) -> set[str]:
        """Those of some ids whose keys are neither unknown nor expired nor revoked."""
        with self._database.read() as connection:
            return set(connection.scalars(sa.select(table.c.id).where(_is_valid(), table.c.id.in_(set(ids)))))

    def list(self) -> list[KeyRecord]:
        """All keys, newest first, the revoked ones too."""
        with self._database.read() as connection:
            rows = connection.execute(sa.select(table).order_by(table.c.created.desc(), table.c.id)).mappings()
            return [_record(row) for row in rows]

    def names(self, ids: Collection[str]) -> dict[str, str]:
        """Names of keys by id, the revoked ones too; what is no id of a key is left out."""
        with self._database.read() as connection:
            rows = connection.execute(sa.select(table.c.id, table.c.name).where(table.c.id.in_(set(ids))))
            return {row.id: row.name for row in rows}

    def revoke(self, key_id: str) -> KeyRecord:
        """Revokes a key; revoking it again changes nothing.

        Raises:
            Problem: There is no such key.
        """

        def body(connection: sa.Connection) -> Any:
            mine = table.c.id == key_id
            connection.execute(table.update().where(mine, table.c.revoked.is_(None)).values(revoked=time.time()))
            return connection.execute(sa.select(table).where(mine)).mappings().first()

        row = self._database.retry(body, _PATIENCE_SECONDS)
        if row is None:
            raise Problem(f"There is no key {key_id}.", "List the keys.", ExitCode.NOT_FOUND)
        return _record(row)

    def any(self) -> bool:
        """Whether there is a key that is not revoked and not expired."""
        with self._database.read() as connection:
            return connection.scalar(sa.select(table.c.id).where(_is_valid()).limit(1)) is not None

    def _used(self, row: Any) -> KeyRecord | None:
        now = time.time()
        if row is None or row["revoked"] is not None or (row["expires"] or now + 1.0) <= now:
            return None
        if now - (row["last_used"] or 0.0) > _USED_SECONDS:
            self._note_use(row["id"], now)
        return _record(row)

    def _note_use(self, key_id: str, now: float) -> None:
        """At most once a minute, so that reading does not become writing; by one of the requests of this process."""
        with self._lock:
            if now - self._noted.get(key_id, 0.0) <= _USED_SECONDS:
                return
            self._noted[key_id] = now
        stale = sa.or_(table.c.last_used.is_(None), table.c.last_used < now - _USED_SECONDS)
        with self._database.write() as connection:
            connection.execute(table.update().where(table.c.id == key_id, stale).values(last_used=now))


def _is_valid() -> sa.ColumnElement[bool]:
    return sa.and_(table.c.revoked.is_(None), sa.or_(table.c.expires.is_(None), table.c.expires > time.time()))


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()


def _record(row: Any) -> KeyRecord:
    return KeyRecord(
        id=row["id"],
        name=row["name"],
        scopes=tuple(row["scopes"]),
        created=iso(row["created"]),
        expires=iso(row["expires"]) if row["expires"] is not None else None,
        revoked=iso(row["revoked"]) if row["revoked"] is not None else None,
        last_used=iso(row["last_used"]) if row["last_used"] is not None else None,
        bounds=JobBounds(**{name: row[name] for name in JobBounds.model_fields}),
    )
