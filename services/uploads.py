"""Uploads that can be resumed: parts are appended one after the other, and become a blob when the hash holds."""

from __future__ import annotations

import hashlib
import secrets
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import sqlalchemy as sa

from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from services.database import Database
from services.database.tables import uploads as table
from services.problems import Refusal
from services.storage import Blobs

QUOTA_BYTES = 4 * LIMITS.upload_bytes
"""Bytes that the unfinished uploads of one key may announce."""

QUOTA_UPLOADS = 256
"""Unfinished uploads of one key."""

_PATIENCE_SECONDS = 5.0


@dataclass(frozen=True)
class Upload:
    """An upload.

    Attributes:
        id: `upl_` and 24 hex digits.
        sha256: Of the whole file.
        bytes: Of the whole file.
        received: Bytes that are there.
        complete: Whether the file is a blob now.
        made_by: Id of the key that began it.
    """

    id: str
    sha256: str
    bytes: int
    received: int
    complete: bool
    made_by: str = ""


@dataclass
class _Turn:
    lock: threading.Lock = field(default_factory=threading.Lock)
    waiting: int = 0


class Uploads:
    """The uploads of a service.

    Args:
        database: How far each of them is.
        blobs: Their parts, and what becomes of them.
    """

    def __init__(self, database: Database, blobs: Blobs) -> None:
        self._database, self._blobs = database, blobs
        self._turns: dict[str, _Turn] = {}
        self._guard = threading.Lock()

    def begin(self, sha256: str, size: int, by: str) -> Upload | None:
        """Begins an upload, or goes on with one of the same file by the same key.

        Returns:
            The upload; None if the blob is there.

        Raises:
            Problem: Too much is under way for this key, or an empty file does not have that hash.
        """
        if self._blobs.has(sha256):
            return None
        if size == 0:
            if sha256 != hashlib.sha256().hexdigest():
                raise Problem("An empty file does not have that sha256.", "Hash the file again.", ExitCode.CHECK_FAILED)
            self._blobs.put_bytes(b"")
            return None
        new = f"upl_{secrets.token_hex(12)}"
        row = {"id": new, "sha256": sha256, "bytes": size, "received": 0, "created": time.time(), "created_by": by}
        unfinished = sa.and_(table.c.created_by == by, table.c.finished.is_(None))

        def insert(connection: sa.Connection) -> Any:
            same = sa.select(table).where(unfinished, table.c.sha256 == sha256, table.c.bytes == size)
            found = connection.execute(same.order_by(table.c.received.desc())).mappings().first()
            if found is not None:
                return found
            totals = sa.select(sa.func.count(), sa.func.coalesce(sa.func.sum(table.c.bytes), 0)).where(unfinished)
            count, announced = connection.execute(totals).one()
            if count >= QUOTA_UPLOADS or int(announced) + size > QUOTA_BYTES:
                raise Problem(
                    f"A key has at most {QUOTA_UPLOADS} uploads of {QUOTA_BYTES} bytes in all under way.",
                    "Finish or delete unfinished uploads.",
                    ExitCode.LIMIT,
                )
            connection.execute(table.insert().values(**row))
            return {**row, "finished": None}

        return _upload(self._database.retry(insert, _PATIENCE_SECONDS))

    def get(self, upload_id: str) -> Upload:
        """An upload.

        Raises:
            Problem: There is none of that id.
        """
        with self._database.read() as connection:
            return _upload(_row(connection, sa.select(table).where(table.c.id == upload_id), upload_id))

    def append(self, upload_id: str, offset: int, data: bytes) -> Upload:
        """Appends a part; when it is the last, the whole is verified and becomes a blob.

        Of several requests with the same offset one is appended, and the others are refused. Nothing at the end of a
        whole upload is a request to verify it again.

        Raises:
            Refusal: The part does not begin where the upload ends.
            Problem: There is no such upload, the part goes beyond its end, or the whole has another hash: then the
                upload is gone.
        """
        with self._turn(upload_id):
            upload = self._append(upload_id, offset, data)
            whole = upload.received == upload.bytes
            return self._finish(upload) if whole and not upload.complete else upload

    def delete(self, upload_id: str) -> None:
        """Gives an upload up; a blob that it became stays.

        Raises:
            Problem: There is none of that id.
        """
        self.get(upload_id)
        self._remove(upload_id)
        self._blobs.discard(upload_id)

    def _append(self, upload_id: str, offset: int, data: bytes) -> Upload:
        with self._held(upload_id) as (row, received):
            upload = _upload(row)
            if upload.complete:
                return upload
            if offset != upload.received:
                raise Refusal(
                    "wrong-offset",
                    f"The upload has {upload.received} bytes; the part begins at {offset}.",
                    more={"received": upload.received},
                )
            end = offset + len(data)
            if end > upload.bytes:
                raise Problem("The part goes beyond the end of the file.", "Send the rest only.", ExitCode.LIMIT)
            if data:
                self._blobs.append_part(upload_id, offset, data)
                received(end)
        return _upload({**row, "received": end})

    def _finish(self, upload: Upload) -> Upload:
        try:
            self._blobs.assemble(upload.id, upload.sha256, upload.bytes)
        except Problem as problem:
            if problem.code is ExitCode.CHECK_FAILED:  # the parts are gone: what is left is not worth resuming
                self._remove(upload.id)
            raise

        def update(connection: sa.Connection) -> None:
            connection.execute(table.update().where(table.c.id == upload.id).values(finished=time.time()))

        self._database.retry(update, _PATIENCE_SECONDS)
        return replace(upload, received=upload.bytes, complete=True)

    def _remove(self, upload_id: str) -> None:
        self._database.retry(
            lambda connection: connection.execute(table.delete().where(table.c.id == upload_id)), _PATIENCE_SECONDS
        )

    @contextmanager
    def _turn(self, upload_id: str) -> Iterator[None]:
        """One request at a time for an upload, in this process."""
        with self._guard:
            turn = self._turns.setdefault(upload_id, _Turn())
            turn.waiting += 1
        try:
            with turn.lock:
                yield
        finally:
            with self._guard:
                turn.waiting -= 1
                if not turn.waiting:
                    del self._turns[upload_id]

    @contextmanager
    def _held(self, upload_id: str) -> Iterator[tuple[Any, Any]]:
        """The row, held against other processes while the part is stored, and how to say what has been received.

        SQLite has no locks of rows, only one of the whole database, which is not held while a part is written: there
        the server is one process, and `_turn` is enough.
        """
        query = sa.select(table).where(table.c.id == upload_id)
        if not self._database.is_postgresql:
            with self._database.read() as connection:
                row = _row(connection, query, upload_id)
            yield (
                row,
                lambda end: self._database.retry(
                    lambda connection: _set_received(connection, upload_id, end), _PATIENCE_SECONDS
                ),
            )
            return
        with self._database.write() as connection:
            row = _row(connection, query.with_for_update(), upload_id)
            yield row, lambda end: _set_received(connection, upload_id, end)


def _set_received(connection: sa.Connection, upload_id: str, end: int) -> None:
    connection.execute(table.update().where(table.c.id == upload_id).values(received=end))


def _row(connection: sa.Connection, query: sa.Select[Any], upload_id: str) -> Any:
    row = connection.execute(query).mappings().first()
    if row is None:
        raise Problem(f"There is no upload {upload_id}.", "Start a new upload.", ExitCode.NOT_FOUND)
    return row


def _upload(row: Any) -> Upload:
    return Upload(
        row["id"], row["sha256"], row["bytes"], row["received"], row["finished"] is not None, row["created_by"]
    )
