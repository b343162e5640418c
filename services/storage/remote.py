"""An S3-compatible object store: the few operations that storage is made of, with errors a user can act on."""

from __future__ import annotations

import errno
import logging
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from pathlib import Path
from typing import Self, TypeVar

import obstore
from obstore.exceptions import AlreadyExistsError, BaseError, PermissionDeniedError, UnauthenticatedError
from obstore.store import S3Store

from schemas.problem import ExitCode, Problem
from stages.store import StoreAway

RANGE_BYTES = 16 << 20
"""Bytes of one request when a large object is read: each request is repeated by itself if its connection is cut."""

USED_SECONDS = 12 * 3600.0
"""How stale the note of an object's last use may be; retention counts in days."""

_PAUSE = timedelta(seconds=2)
"""Longest time between two tries: a store that is back is used again within it."""
_USED = "used"
_FULL = ("XMinioStorageFull", "QuotaExceeded", "InsufficientStorage", "507 Insufficient Storage")
"""What servers call it."""

_CUT = "HTTP error"
"""What the client calls a connection that failed, other than an answer that tells of an error."""

T = TypeVar("T")

log = logging.getLogger(__name__)


class TornError(ValueError):
    """An object is shorter than it was written."""


@dataclass(frozen=True)
class Entry:
    """An object: its key, bytes, and when it was written in seconds since 1970 UTC."""

    key: str
    bytes: int
    modified: float


class Remote:
    """Objects under a prefix of a bucket.

    An object's last use is noted as the time of an empty object under `used/`, since S3 keeps only that of writing.

    Args:
        store: The bucket and prefix.
        patience: Seconds for which a request is repeated whose connection was cut; what was not connected at all, or
            was answered with an error of the server's, the client repeats by itself.
    """

    def __init__(self, store: S3Store, patience: float = 20.0) -> None:
        self._store, self._patience = store, patience
        self._used: dict[str, float] = {}
        self._lock = threading.Lock()

    @classmethod
    def open(cls, url: str, patience: float = 20.0) -> Self:
        """The store that `s3://bucket/prefix` names; credentials, region and endpoint from `AWS_*`.

        Args:
            url: Of the store.
            patience: Seconds for which a request that is not answered is repeated.

        Raises:
            Problem: The URL names no bucket.
        """
        bucket, _, prefix = url.removeprefix("s3://").partition("/")
        if not bucket:
            raise Problem(f"The store URL {url} names no bucket.", "Set DIAPHANE_STORE to s3://BUCKET/PREFIX.")
        endpoint = os.environ.get("AWS_ENDPOINT_URL_S3") or os.environ.get("AWS_ENDPOINT_URL", "")
        store = S3Store(
            bucket,
            prefix=prefix.strip("/") or None,
            client_options={"allow_http": endpoint.startswith("http://"), "timeout": timedelta(minutes=5)},
            retry_config={
                "max_retries": 10_000,
                "retry_timeout": timedelta(seconds=patience),
                "backoff": {"init_backoff": timedelta(seconds=0.1), "max_backoff": _PAUSE, "base": 2},
            },
        )
        return cls(store, patience)

    def head(self, key: str) -> Entry | None:
        """The object, without its content; None if it is absent."""
        try:
            meta = self._asked(lambda: obstore.head(self._store, key))
        except FileNotFoundError:
            return None
        return Entry(key, meta["size"], meta["last_modified"].timestamp())

    def get(self, key: str) -> tuple[bytes, float] | None:
        """Content of a small object and when it was written; None if it is absent."""

        def read() -> tuple[bytes, float]:
            result = obstore.get(self._store, key)
            return bytes(result.bytes()), result.meta["last_modified"].timestamp()

        try:
            return self._asked(read)
        except FileNotFoundError:
            return None

    def range(self, key: str, start: int, end: int) -> Iterator[bytes]:
        """The bytes of an object from `start` up to but not including `end`, in chunks.

        Raises:
            TornError: The object ends before `end`, or is absent.
        """
        while start < end:
            stop = min(end, start + RANGE_BYTES)
            try:
                read = partial(obstore.get_range, self._store, key, start=start, end=stop)
                chunk = bytes(self._asked(read))
            except (FileNotFoundError, Problem) as error:
                entry = self.head(key)  # some servers answer a range beyond the end with an error
                if entry is None or entry.bytes < stop:
                    raise TornError(f"{key} is absent or too short") from error
                raise
            if len(chunk) != stop - start:
                raise TornError(f"{key} is too short")
            yield chunk
            start = stop

    def put(self, key: str, content: bytes | Path | Iterable[bytes]) -> None:
        """Writes an object, replacing one that is there; readers see all of it or none.

        Raises:
            OSError: The content cannot be read.
        """
        try:
            if isinstance(content, bytes | Path):
                self._asked(lambda: self._write(key, content))
            else:  # it may be read once only
                with _reported():
                    self._write(key, iter(content))
        except FileNotFoundError as error:
            if isinstance(content, Path) and not content.exists():
                raise
            raise Problem(
                "The bucket of the object store does not exist.",
                "Create it, or correct DIAPHANE_STORE (s3://BUCKET/PREFIX).",
                ExitCode.NOT_FOUND,
            ) from error

    def create(self, key: str, content: bytes) -> bool:
        """Writes an object only if it is absent; whether it was."""
        tries = 0

        def write() -> bool:
            nonlocal tries
            tries += 1
            try:
                obstore.put(self._store, key, content, mode="create")
            except AlreadyExistsError:
                if tries == 1:
                    return False
                # The try before it may have arrived although its answer did not.
                return bytes(obstore.get(self._store, key).bytes()) == content
            return True

        return self._asked(write)

    def delete(self, keys: Sequence[str]) -> None:
        """Removes objects, whether they are there or not."""
        if keys:
            self._asked(lambda: obstore.delete(self._store, list(keys)))

    def list(self, prefix: str) -> Iterator[Entry]:
        """All objects in a folder and those below it."""
        with _reported():
            for page in obstore.list(self._store, prefix, chunk_size=1000):
                for meta in page:
                    yield Entry(meta["path"], meta["size"], meta["last_modified"].timestamp())

    def touch(self, name: str, modified: float = 0.0) -> None:
        """Notes a use of something, unless another one is known to be recent.

        Args:
            name: What was used, a relative path.
            modified: When it was written, if that is known: a use as well.
        """
        now = time.time()
        with self._lock:
            if now - max(modified, self._used.get(name, 0.0)) < USED_SECONDS:
                return
            self._used[name] = now
        self.put(f"{_USED}/{name}", b"")

    def forget(self, name: str) -> None:
        """Removes the note of the last use."""
        self._used.pop(name, None)
        self.delete([f"{_USED}/{name}"])

    def used(self, prefix: str) -> dict[str, float]:
        """Notes of last uses: name -> seconds since 1970 UTC, for names below a prefix."""
        return {
            entry.key.removeprefix(f"{_USED}/"): entry.modified for entry in self.list(f"{_USED}/{prefix}".rstrip("/"))
        }

    def _write(self, key: str, source: bytes | Path | Iterator[bytes]) -> None:
        obstore.put(self._store, key, source, chunk_size=RANGE_BYTES, max_concurrency=4)

    def _asked(self, request: Callable[[], T]) -> T:
        """The answer to a request that may be sent again."""
        end, wait = time.monotonic() + self._patience, 0.1
        while True:
            try:
                with _reported():
                    return request()
            except _CutError:
                if time.monotonic() + wait > end:
                    raise
                time.sleep(wait)
                wait = min(_PAUSE.total_seconds(), 2.0 * wait)


class _CutError(StoreAway):
    """The connection was lost before the answer came."""


@contextmanager
def _reported() -> Iterator[None]:
    """Turns the client's errors into problems; absence and presence stay exceptions of their own."""
    try:
        yield
    except AlreadyExistsError:
        raise
    except (PermissionDeniedError, UnauthenticatedError) as error:
        log.warning("The object store refused a request: %s", _first_line(error))
        raise Problem(
            "The object store refused the credentials.",
            "Set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY to a key that may read and write the bucket.",
            ExitCode.AUTH,
        ) from error
    except BaseError as error:
        log.warning("The object store failed: %s", _first_line(error))
        if any(word in str(error) for word in _FULL):
            raise OSError(errno.ENOSPC, "the object store is full") from error
        raise (_CutError if _CUT in str(error) else StoreAway)(
            "The object store cannot be reached, or could not do what was asked.",
            "Check that it runs and AWS_ENDPOINT_URL is right, then try again.",
        ) from error


def _first_line(error: BaseError) -> str:
    return str(error).partition("\n")[0]
