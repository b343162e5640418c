"""Sessions of browsers: an opaque random token stands for an API key until it expires.

- The token is in a cookie that no script can read; the database has its hash, which signs nobody in.
- A session is as good as its key: where the key is revoked or expires, the session has ended.
- Forms carry a second token that follows from the first, so that no other site can fill them in.
"""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
import time
from collections.abc import Collection

import sqlalchemy as sa

from schemas.service import KeyRecord
from services.database import Database
from services.database.tables import sessions as table
from services.keys import Found, Keys

LIFETIME_SECONDS = 12 * 3600.0
"""After which one signs in again."""

_PATIENCE_SECONDS = 5.0
_TOKEN = re.compile(r"[A-Za-z0-9_-]{43}")


class Sessions:
    """The sessions of a service.

    Args:
        database: Where they are.
        keys: What they stand for.
    """

    def __init__(self, database: Database, keys: Keys) -> None:
        self._database, self._keys = database, keys

    def open(self, key: KeyRecord) -> str:
        """Begins a session of a key, and forgets those that have expired.

        Returns:
            The token: 256 random bits.
        """
        token, now = secrets.token_urlsafe(32), time.time()
        row = {"digest": digest_of(token), "key_id": key.id, "created": now, "expires": now + LIFETIME_SECONDS}

        def body(connection: sa.Connection) -> None:
            connection.execute(table.delete().where(table.c.expires <= now))
            if connection.scalar(sa.select(table.c.digest).where(table.c.digest == row["digest"])) is None:
                connection.execute(table.insert().values(**row))

        self._database.retry(body, _PATIENCE_SECONDS)
        return token

    def find(self, token: str) -> Found:
        """What a token stands for; nothing if the session or its key has ended, or there was none."""
        if not _TOKEN.fullmatch(token):
            return Found(None)
        mine = table.c.digest == digest_of(token)
        with self._database.read() as connection:
            row = connection.execute(sa.select(table.c.key_id, table.c.expires).where(mine)).first()
        if row is None:
            return Found(None, is_guess=True)
        return Found(self._keys.alive(row.key_id) if row.expires > time.time() else None)

    def valid(self, digests: Collection[str]) -> set[str]:
        """Those of some tokens, as `digest_of`, whose sessions have not ended."""
        mine = table.c.digest.in_(set(digests)) & (table.c.expires > time.time())
        with self._database.read() as connection:
            return set(connection.scalars(sa.select(table.c.digest).where(mine)))

    def close(self, token: str) -> None:
        """Ends a session; ending it again changes nothing."""
        ended = table.delete().where(table.c.digest == digest_of(token))
        self._database.retry(lambda connection: connection.execute(ended), _PATIENCE_SECONDS)


def form_token(token: str) -> str:
    """What the forms of a session carry."""
    return hmac.new(token.encode(), b"diaphane form", hashlib.sha256).hexdigest()


def digest_of(token: str) -> str:
    """What is kept of a token."""
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).hexdigest()
