"""The registry's signing key, and how another one follows it.

Rules:
- a registry has one key: that of its last handover, or else that which its versions are signed with; a process with
  another key signs nothing;
- a handover is a statement that the old key signs; clients follow a row of them from the key that they know;
- with a handover every version is signed again, so that all signatures are those of the registry's key; a version
  whose signature was wrong before is left as it is;
- a key that was lost cannot sign its handover: the row begins anew, and clients have to be told of the new key.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import sqlalchemy as sa

from schemas.problem import ExitCode, Problem
from schemas.service import HandoverRecord
from services.database import Database
from services.database.tables import handovers, versions
from services.registry.signing import (
    KEY_FILE,
    NEXT_KEY_FILE,
    Signer,
    SigningKey,
    handover_statement,
    make_key_file,
    read_seed,
    verify,
)
from services.settings import Settings
from stages.store import sync

_LOCK = 0x64696B65  # of the registry's key, any number that nobody else uses
MAX_HANDOVERS = 64
"""Of a row: clients read no more."""


@dataclass(frozen=True)
class Rotation:
    """What a rotation did.

    Attributes:
        public_key: The registry's key now, base64.
        signed: Versions that were signed again.
        left: NAME@VERSION of those whose signature was wrong before.
    """

    public_key: str
    signed: int
    left: tuple[str, ...]


def public_key(connection: sa.Connection) -> str | None:
    """The registry's key, base64; None as long as it has signed nothing."""
    last = connection.scalar(sa.select(handovers.c.new_key).order_by(handovers.c.id.desc()).limit(1))
    return last or connection.scalar(sa.select(versions.c.public_key).order_by(versions.c.created.desc()).limit(1))


def share_key(connection: sa.Connection) -> None:
    """Makes a rotation wait for the end of the transaction; in SQLite every transaction that writes is alone anyway."""
    if connection.dialect.name == "postgresql":
        connection.execute(sa.text("select pg_advisory_xact_lock_shared(:number)"), {"number": _LOCK})


def require_key(connection: sa.Connection, key: SigningKey) -> None:
    """Refuses to sign with a key that is not the registry's.

    Raises:
        Problem: It is another one (TRY_AGAIN).
    """
    known = public_key(connection)
    if known and known != key.public_key:
        raise Problem(
            f"This process has the signing key {key.public_key}; that of the registry is {known}.",
            "Give it the registry's key (DIAPHANE_SIGNING_KEY, or signing.key in the state folder), or look at "
            "`diaphane keys rotate-signing --help`.",
            ExitCode.TRY_AGAIN,
        )


def row(connection: sa.Connection, key: SigningKey) -> tuple[HandoverRecord, ...]:
    """The handovers that lead to a key, oldest first, since a key was lost last."""
    wanted, records = key.public_key, list[HandoverRecord]()
    for each in connection.execute(sa.select(handovers).order_by(handovers.c.id.desc())):
        if each.new_key != wanted:  # a later one, of a moment ago
            continue
        if each.statement is None or len(records) == MAX_HANDOVERS:
            break
        records.insert(0, HandoverRecord(statement=each.statement, signature=each.signature))
        wanted = each.old_key
    return tuple(records)


def retired_keys(connection: sa.Connection) -> list[str]:
    """Public keys that were the registry's before, latest first."""
    return list(connection.scalars(sa.select(handovers.c.old_key).order_by(handovers.c.id.desc())))


def rotate(database: Database, settings: Settings, new_seed: bytes | None = None) -> Rotation:
    """Hands over from the present key to a new one.

    A key file is replaced, once the database has the handover: a rotation that was cut short is finished by the next
    one. A key of the settings is not in our hands: whoever starts the processes gives them the new one.

    Args:
        database: Of the registry.
        settings: Where the present key is.
        new_seed: 32 bytes of the new key; None: random ones, which only a key file can take.

    Raises:
        Problem: The present key is not the registry's, or the new one was used before, or there is none.
        OSError: A key file cannot be read or written.
    """
    path, following = settings.state / KEY_FILE, settings.state / NEXT_KEY_FILE
    if settings.signing_key:
        if new_seed is None:
            raise Problem(
                "The key is that of DIAPHANE_SIGNING_KEY, which cannot be changed from here.",
                "Make another one, `openssl rand -base64 32 > new.key`, and give it: --new-key new.key.",
            )
        return _hand_over(database, Signer.open(settings).key, SigningKey(new_seed))
    old = Signer.open(settings).key
    make_key_file(following, new_seed)
    seed = read_seed(following)
    if new_seed not in (None, seed):
        raise Problem(
            f"A rotation to another key was cut short: {following} has that key.",
            "Run the command without --new-key, which ends that one; then repeat this.",
            ExitCode.CONFLICT,
        )
    made = _hand_over(database, old, SigningKey(seed))
    following.replace(path)
    sync(path.parent)
    return made


def replace_lost(database: Database, settings: Settings) -> Rotation:
    """Makes the key of the settings that of the registry, whose own one is lost: clients have to be told of it.

    Raises:
        Problem: The key of the settings was the registry's before.
        OSError: The key file can be neither read nor made.
    """
    return _hand_over(database, None, Signer.open(settings).key)


def _hand_over(database: Database, old: SigningKey | None, new: SigningKey) -> Rotation:
    """Writes the handover down and signs every version again; finds what was done if it was done before."""

    def body(connection: sa.Connection) -> Rotation:
        if connection.dialect.name == "postgresql":
            connection.execute(sa.text("select pg_advisory_xact_lock(:number)"), {"number": _LOCK})
        present = public_key(connection) or (old or new).public_key
        if present == new.public_key:
            return Rotation(present, 0, ())
        if old:
            require_key(connection, old)
        if new.public_key in retired_keys(connection):
            raise Problem("The new key was the registry's before.", "Make another one.", ExitCode.CONFLICT)
        text = handover_statement(present, new.public_key, int(time.time())) if old else None
        signature = old.sign(text) if old and text else None
        values = {"old_key": present, "new_key": new.public_key, "statement": text, "signature": signature}
        connection.execute(handovers.insert().values(**values, at=time.time()))
        return _sign_again(connection, present, new)

    return database.retry(body)


def _sign_again(connection: sa.Connection, old: str, new: SigningKey) -> Rotation:
    signed, left = 0, []
    for each in connection.execute(sa.select(versions)).all():
        if each.public_key != old or not verify(old, each.statement, each.signature):
            left.append(f"{each.name}@{each.version}")
            continue
        mine = (versions.c.name == each.name) & (versions.c.version == each.version)
        values = {"signature": new.sign(each.statement), "public_key": new.public_key}
        connection.execute(versions.update().where(mine).values(**values))
        signed += 1
    return Rotation(new.public_key, signed, tuple(left))
