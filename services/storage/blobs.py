"""Blobs: bytes named by their sha256, and the parts of uploads that become blobs.

    root/blobs/sha256/<ab>/<sha256>     a blob; its access time is that of its last use
    root/uploads/<id>/<offset>          a part of an upload, by the offset of its first byte
    root/tmp/                           being written, or left by a crash (`stages.store` clears it)
    root/damaged/                       blobs that no longer matched their name

Rules:
- a blob is complete or absent: written under a temporary name while it is hashed, synced, then renamed;
- a process hashes a blob before it hands it out the first time, also one that it stored itself, and again when it is
  another file, or its size or one of its times of change is not what it was when it last matched;
- a damaged blob counts as missing, and storing the same bytes again heals it;
- a store whose folder is gone is away, which says nothing of the blobs that are in it;
- names come from clients, so that only 64 hex digits, and ids of uploads, are ever made into paths.
"""

from __future__ import annotations

import errno
import hashlib
import io
import logging
import os
import re
import shutil
import time
import uuid
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from schemas.canonical import file_sha256
from schemas.problem import ExitCode, Problem
from schemas.service import FileRef
from stages.store import TOUCH_SECONDS, StoreAway, sync

CHUNK = 1 << 20
"""Bytes read and written at a time."""

LEAST_FREE_BYTES = 64 << 20
"""Below this a store is full: two parts of an upload."""

_PROBE_BYTES = 4096
_SHA256 = re.compile(r"[0-9a-f]{64}")
_UPLOAD = re.compile(r"[a-z]{3}_[0-9a-f]{12,64}")

log = logging.getLogger(__name__)


class MissingBlob(Problem):
    """A blob is absent, or was damaged and has been moved aside.

    Args:
        sha256: Its name.
    """

    def __init__(self, sha256: str) -> None:
        super().__init__(
            f"The store has no file with the sha256 {sha256[:64]}.",
            "Upload that file again; for a published bundle, publish the same bundle again.",
            ExitCode.NOT_FOUND,
        )
        self.sha256 = sha256


class Blobs:
    """Blobs under one folder. Any number of processes may share it.

    Args:
        root: Folder; created if missing.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._temporary = root / "tmp"
        self._temporary.mkdir(parents=True, exist_ok=True)
        self._verified: dict[str, _State] = {}

    def put_file(self, path: Path) -> FileRef:
        """Stores a file's content; nothing to write if it is there already.

        Raises:
            OSError: The file cannot be read, or the store cannot be written.
        """
        with path.open("rb") as stream:
            return self._ingest(_chunks(stream))

    def put_bytes(self, data: bytes) -> FileRef:
        """Stores bytes; nothing to write if they are there already.

        Raises:
            OSError: The store cannot be written.
        """
        return self._ingest(_chunks(io.BytesIO(data)))

    def has(self, sha256: str) -> bool:
        """Whether the blob is there, without reading it; counts as a use of it."""
        return self.size(sha256) is not None

    def size(self, sha256: str) -> int | None:
        """Bytes of the blob, without reading it; None if it is absent. Counts as a use of it."""
        try:
            size = self._path(sha256).stat().st_size
        except FileNotFoundError:
            self._require_there()
            return None
        except ValueError:
            return None
        self._touch(sha256)
        return size

    def path(self, sha256: str) -> Path:
        """A local file with the blob's verified content, to be read only.

        Raises:
            MissingBlob: It is absent, or was damaged and has been moved aside.
        """
        try:
            path = self._path(sha256)
        except ValueError:
            raise MissingBlob(sha256) from None
        if not self._intact(sha256):
            self._require_there()
            raise MissingBlob(sha256)
        self._touch(sha256)
        return path

    def read(self, sha256: str, start: int = 0, end: int | None = None) -> Iterator[bytes]:
        """The blob's bytes from `start` up to but not including `end`, in chunks of at most 1 MiB.

        Raises:
            MissingBlob: As for `path`; at the call, not at the first chunk.
        """
        try:
            stream = self.path(sha256).open("rb")
        except FileNotFoundError:
            raise MissingBlob(sha256) from None
        return _range(stream, start, end)

    def probe(self) -> None:
        """Makes sure that the store is there and takes what is written.

        Raises:
            Problem: It is away.
            OSError: It cannot be written, or has less than `LEAST_FREE_BYTES` left.
        """
        self._require_there()
        if shutil.disk_usage(self.root).free < LEAST_FREE_BYTES:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        path = self._temporary / f"probe-{uuid.uuid4().hex}"
        try:
            path.write_bytes(bytes(_PROBE_BYTES))
        finally:
            path.unlink(missing_ok=True)

    def remove(self, sha256: str) -> None:
        """Removes a blob; does nothing if it is absent. Files opened before can still be read."""
        self._path(sha256).unlink(missing_ok=True)
        self._verified.pop(sha256, None)

    def all(self) -> Iterator[tuple[str, int, float]]:
        """All blobs: sha256, bytes, and when it was last used in seconds since 1970 UTC."""
        for path in self._folder.glob("??/*"):
            if not _SHA256.fullmatch(path.name):
                continue
            with suppress(FileNotFoundError):
                stat = path.stat()
                yield path.name, stat.st_size, max(stat.st_atime, stat.st_mtime)

    def cached(self) -> Iterator[tuple[str, int, float]]:
        """Local copies of blobs that lie in an object store, as `all` tells of them: none here."""
        return iter(())

    def drop(self, sha256: str) -> None:
        """Removes the local copy of a blob that lies in an object store."""

    def append_part(self, upload_id: str, offset: int, data: bytes) -> None:
        """Stores a part of an upload; the same offset again replaces it.

        Args:
            upload_id: The upload.
            offset: Position of the part's first byte in the file.
            data: Its bytes.

        Raises:
            OSError: The store cannot be written.
        """
        self._require_there()
        folder = self._upload(upload_id)
        folder.mkdir(parents=True, exist_ok=True)
        temporary = self._temporary / f"part-{uuid.uuid4().hex}"
        try:
            with temporary.open("wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            temporary.replace(folder / f"{offset:020d}")
            sync(folder)
        finally:
            temporary.unlink(missing_ok=True)

    def assemble(self, upload_id: str, sha256: str, size: int) -> FileRef:
        """Makes a blob of an upload's parts and removes them; finds the blob if that was done before.

        Args:
            upload_id: The upload.
            sha256: Of the whole file.
            size: Bytes of the whole file.

        Raises:
            Problem: Parts are missing (CONFLICT), or the bytes do not have that hash (CHECK_FAILED): the parts are
                removed, and the upload begins anew.
            OSError: The store cannot be written.
        """
        parts = dict(self._parts(upload_id))
        if not parts and self.size(sha256) == size:
            return FileRef(sha256=sha256, bytes=size)
        chain, position = [], 0
        while position < size and parts.get(position, 0) > 0:
            chain.append(position)
            position += parts[position]
        if position != size:
            raise Problem(
                f"The upload {upload_id} has its first {position} of {size} bytes.",
                f"Send the part that begins at byte {min(position, size)}, or begin a new upload.",
                ExitCode.CONFLICT,
            )
        try:
            reference = self._ingest(self._part_chunks(upload_id, chain, parts), sha256)
        except _OtherContentError as error:
            self.discard(upload_id)
            raise Problem(
                f"The bytes of the upload {upload_id} have the sha256 {error.found}, not {sha256}.",
                "Upload the file again; it changed, or was damaged on its way.",
                ExitCode.CHECK_FAILED,
            ) from None
        self.discard(upload_id)
        return reference

    def discard(self, upload_id: str) -> None:
        """Removes the parts of an upload; does nothing if there are none."""
        shutil.rmtree(self._upload(upload_id), ignore_errors=True)

    def uploads(self) -> Iterator[tuple[str, float]]:
        """Uploads with parts in the store, and when the last part came, in seconds since 1970 UTC."""
        for folder in (self.root / "uploads").glob("*"):
            if _UPLOAD.fullmatch(folder.name):
                with suppress(FileNotFoundError):
                    yield folder.name, folder.stat().st_mtime

    def _parts(self, upload_id: str) -> Iterator[tuple[int, int]]:
        """Offset and bytes of the parts of an upload."""
        for path in self._upload(upload_id).glob("*"):
            yield int(path.name), path.stat().st_size

    def _part_chunks(self, upload_id: str, chain: list[int], parts: dict[int, int]) -> Iterator[bytes]:
        for offset in chain:
            with (self._upload(upload_id) / f"{offset:020d}").open("rb") as stream:
                yield from _chunks(stream)

    def _ingest(self, chunks: Iterable[bytes], expected: str | None = None) -> FileRef:
        """Stores a stream, hashing it on the way; with `expected`, only if it has that hash."""
        self._require_there()
        temporary = self._temporary / f"blob-{uuid.uuid4().hex}"
        digest, size = hashlib.sha256(), 0
        try:
            with temporary.open("wb") as stream:
                for chunk in chunks:
                    digest.update(chunk)
                    stream.write(chunk)
                    size += len(chunk)
                stream.flush()
                os.fsync(stream.fileno())
            sha256 = digest.hexdigest()
            if expected is not None and sha256 != expected:
                raise _OtherContentError(sha256)
            self._keep(temporary, sha256)
        finally:
            temporary.unlink(missing_ok=True)
        return FileRef(sha256=sha256, bytes=size)

    def _keep(self, temporary: Path, sha256: str) -> None:
        path = self._path(sha256)
        if self._intact(sha256):
            self._touch(sha256)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.replace(path)
        sync(path.parent)

    def _intact(self, sha256: str) -> bool:
        """Whether the blob is there and matches its name; a damaged one is moved aside."""
        path = self._path(sha256)
        try:
            before = _state(path)
            if self._verified.get(sha256) == before:
                return True
            if file_sha256(path) == sha256:
                self._verified[sha256] = before
                return True
            self._set_aside(path)
        except FileNotFoundError:
            pass
        return False

    def _set_aside(self, path: Path) -> None:
        target = self.root / "damaged" / f"blob-{path.name}-{uuid.uuid4().hex[:8]}"
        target.parent.mkdir(exist_ok=True)
        log.warning("The blob %s does not match its name: moved to %s.", path, target)
        path.rename(target)

    @property
    def _folder(self) -> Path:
        return self.root / "blobs" / "sha256"

    def _path(self, sha256: str) -> Path:
        if not _SHA256.fullmatch(sha256):
            raise ValueError("A blob's name is 64 hex digits.")
        return self._folder / sha256[:2] / sha256

    def _upload(self, upload_id: str) -> Path:
        if not _UPLOAD.fullmatch(upload_id):
            raise ValueError("That is not the id of an upload.")
        return self.root / "uploads" / upload_id

    def _require_there(self) -> None:
        """Refuses to say that a blob is absent where the whole store is.

        Raises:
            StoreAway: Always then.
        """
        if not self._temporary.is_dir():
            raise StoreAway("The store cannot be reached.", "Mount its folder again, then repeat this.")

    def _touch(self, sha256: str) -> None:
        """Writes down a use, as the time of access: the time of change belongs to the verification."""
        path = self._path(sha256)
        with suppress(OSError):
            stat = path.stat()
            if time.time() - max(stat.st_atime, stat.st_mtime) > TOUCH_SECONDS:
                before = _state_of(stat)
                os.utime(path, ns=(time.time_ns(), stat.st_mtime_ns))
                if self._verified.get(sha256) == before:
                    self._verified[sha256] = _state(path)  # the times of the inode are others now


class _OtherContentError(Exception):
    """A stream has another hash than was said."""

    def __init__(self, found: str) -> None:
        super().__init__(found)
        self.found = found


_State = tuple[int, int, int, int]


def _state(path: Path) -> _State:
    return _state_of(path.stat())


def _state_of(stat: os.stat_result) -> _State:
    """What changes when a file does; the time of change of its inode cannot be set back."""
    return stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


def _chunks(stream: BinaryIO) -> Iterator[bytes]:
    while chunk := stream.read(CHUNK):
        yield chunk


def _range(stream: BinaryIO, start: int, end: int | None) -> Iterator[bytes]:
    with stream:
        stream.seek(start)
        left = None if end is None else max(0, end - start)
        while chunk := stream.read(CHUNK if left is None else min(CHUNK, left)):
            yield chunk
            left = None if left is None else left - len(chunk)
