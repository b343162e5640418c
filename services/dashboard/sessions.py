"""Sessions of browsers: an opaque random token stands for an API key until it expires.

- The token is in a cookie that no script can read; the database has its hash, which signs nobody in.
- A session is as good as its key: where the key is revoked or expires, the session has ended.
- Forms carry a second token that follows from the first, so that no other site can fill them in.
"""

from __future__ import annotations

import hashlib
import hmac
import secrets
import time

import sqlalchemy as sa

from schemas.service import KeyRecord
from services.database import Database
from services.database.tables import sessions as table
from services.keys import Keys

LIFETIME_SECONDS = 12 * 3600.0
"""After which one signs in again."""

_PATIENCE_SECONDS = 5.0


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
        row = {"digest": _digest(token), "key_id": key.id, "created": now, "expires": now + LIFETIME_SECONDS}

        def body(connection: sa.Connection) -> None:
            connection.execute(table.delete().where(table.c.expires <= now))
            if connection.scalar(sa.select(table.c.digest).where(table.c.digest == row["digest"])) is None:
                connection.execute(table.insert().values(**row))

        self._database.retry(body, _PATIENCE_SECONDS)
        return token

    def find(self, token: str) -> KeyRecord | None:
        """The key that a token stands for; None if the session or its key has ended, or there was none."""
        mine = (table.c.digest == _digest(token)) & (table.c.expires > time.time())
        with self._database.read() as connection:
            key_id = connection.scalar(sa.select(table.c.key_id).where(mine))
        return None if key_id is None else self._keys.alive(key_id)

    def close(self, token: str) -> None:
        """Ends a session; ending it again changes nothing."""
        ended = table.delete().where(table.c.digest == _digest(token))
        self._database.retry(lambda connection: connection.execute(ended), _PATIENCE_SECONDS)


def form_token(token: str) -> str:
    """What the forms of a session carry."""
    return hmac.new(token.encode(), b"diaphane form", hashlib.sha256).hexdigest()


def _digest(token: str) -> str:
    return hashlib.sha256(token.encode("utf-8", "surrogatepass")).hexdigest()
