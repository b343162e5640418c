"""What an alias means now, signed for a quarter of an hour.

`serial` is the moment of the alias's last move in milliseconds since 1970, and always more than that of the move
before: a client that saw one takes no lower one, whatever version it points at. So an alias may go back to an older
version, and what was signed before that cannot be served after it. As a moment it goes on rising where a database was
restored or made anew: the next move of the alias is beyond all that clients have seen.
"""

from __future__ import annotations

import time
from typing import Final

import sqlalchemy as sa

from schemas.service import PointerRecord
from services.database import Database
from services.database.tables import aliases, moves, versions
from services.registry import handovers
from services.registry.signing import SigningKey, pointer_statement

LIFETIME_SECONDS: Final = 900
"""How long a pointer holds. Clients allow five minutes more, since clocks differ."""


def next_move(connection: sa.Connection, name: str, alias: str) -> float:
    """When an alias moves now, seconds since 1970: later than it ever moved, even if the clock went back."""
    last = _serial(connection.scalar(sa.select(_last_move(name, alias))))
    return max(int(1000.0 * time.time()), last + 1) / 1000.0


def pointer(database: Database, key: SigningKey, name: str, selector: str) -> PointerRecord | None:
    """What an alias or a version means now, signed.

    Args:
        database: Of the registry.
        key: To sign with.
        name: Name of the bundle.
        selector: Alias or version.

    Returns:
        The pointer; None if there is no such alias or version.

    Raises:
        Problem: The key is not the registry's.
    """
    meant = (versions.c.name == aliases.c.name) & (versions.c.version == aliases.c.version)
    asked = (aliases.c.name == name) & (aliases.c.alias == selector)
    # The meaning and the number of its move in one question: else a move could come between them.
    by_alias = sa.select(versions, _last_move(name, selector).label("moved")).join(aliases, meant).where(asked)
    by_number = sa.select(versions, sa.null().label("moved")).where(
        (versions.c.name == name) & (versions.c.version == selector)
    )
    with database.read() as connection:
        found = connection.execute(by_alias).one_or_none() or connection.execute(by_number).one_or_none()
        if found is None:
            return None
        handovers.require_key(connection, key)
        row = handovers.row(connection, key)
    serial = _serial(found.moved)
    issued = int(time.time())
    text = pointer_statement(
        name, selector, found.version, found.digest, serial=serial, issued=issued, expires=issued + LIFETIME_SECONDS
    )
    return PointerRecord(statement=text, signature=key.sign(text), public_key=key.public_key, handovers=row)


def _last_move(name: str, alias: str) -> sa.ScalarSelect[float | None]:
    mine = (moves.c.name == name) & (moves.c.alias == alias)
    return sa.select(sa.func.max(moves.c.at)).where(mine).scalar_subquery()


def _serial(moved: float | None) -> int:
    return 0 if moved is None else round(1000.0 * moved)
