"""Artifacts and blobs in an object store, with a local cache in front of it.

    artifacts/<stage>/<key[:2]>/<key>/pack-<random>   the contents of an artifact's files, one after the other
    artifacts/<stage>/<key[:2]>/<key>/meta.json       as in the local folder, and where each file begins in the pack
    blobs/sha256/<ab>/<sha256>, uploads/<id>/<offset>, used/...

An artifact is one object beside its meta.json because its files may be thousands of small ones (zarr chunks): 200 files
of 4 KiB took 0.52 s to write and 0.52 s to read as objects of their own, and 16 ms and 5 ms as one, against a server on
the same machine; farther away it is worse. A single file is still read by itself, as a range of the pack.

Rules, beside those of the folders:
- what is in the object store counts; the cache may be lost at any time, and what only it holds is sent again;
- an artifact is there when its meta.json is: that is written last and only if absent, so of two writers the first wins;
- everything that comes from the object store is hashed before it is used; what does not match is removed there,
  meta.json first, and counts as missing.
"""

from __future__ import annotations

import hashlib
import json
import logging
import re
import shutil
import uuid
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any

from services.kept import Kept
from services.storage.blobs import CHUNK, Blobs, MissingBlob
from services.storage.remote import RANGE_BYTES, Remote
from stages.store import META, Address, MissingArtifact, Store, StoredArtifact, parse_meta, read_meta

ORPHAN_SECONDS = 24 * 3600.0
"""A pack that has had no meta.json for this long was left by a crash."""

METAS_BYTES = 8 << 20
"""Of the meta.json of artifacts of which single files were read, in memory."""
_FILE_BYTES = 400
"""About what a file takes of them."""

_ARTIFACT_KEY = re.compile(r"artifacts/([a-z][a-z0-9-]*)/[0-9a-f]{2}/([0-9a-f]{64})/(.+)")

log = logging.getLogger(__name__)


class TieredStore(Store):
    """Artifacts in an object store. `put` makes an artifact in the local cache, `push` sends it.

    Args:
        root: Folder of the cache; a child process without a network works on a `Store` with the same root.
        remote: The object store.
    """

    def __init__(self, root: Path, remote: Remote) -> None:
        super().__init__(root)
        self._remote = remote
        self._metas = Kept(METAS_BYTES)

    def fetch(self, artifact: str) -> Path:
        """The local folder of an artifact, downloaded if need be, its files verified.

        Raises:
            MissingArtifact: It is absent, or was damaged and has been removed.
            Problem: The object store cannot be reached.
            OSError: The cache cannot be written.
        """
        try:
            folder = super().fetch(artifact)
        except MissingArtifact:
            return self._download(artifact)
        self._remote.touch(_used_name(artifact))
        return folder

    def holds(self, artifact: str) -> bool:
        """Whether the object store has the artifact; one that only the cache has is sent first.

        Raises:
            Problem: The object store cannot be reached.
        """
        entry = self._remote.head(self._key(artifact, META))
        if entry is not None:
            self._remote.touch(_used_name(artifact), entry.modified)
            return True
        self._metas.drop(artifact)
        if not super().holds(artifact):
            return False
        try:
            self._send(artifact)
        except MissingArtifact:  # the copy in the cache is damaged
            return False
        return True

    def read(self, artifact: str, name: str) -> bytes:
        """The verified content of one small file of an artifact, without downloading the rest.

        Raises:
            MissingArtifact: The artifact is absent, or was damaged and has been removed.
            FileNotFoundError: The artifact has no file of that name.
            Problem: The object store cannot be reached.
        """
        with suppress(MissingArtifact):
            return super().read(artifact, name)
        kept = self._metas.find(artifact)
        if kept is not None:
            with suppress(*_MALFORMED):  # removed by another process, which may have put another pack in its place
                return self._file(artifact, kept, name)
            self._metas.drop(artifact)
        meta, modified = self._remote_meta(artifact)
        self._metas.keep(artifact, meta, _FILE_BYTES * len(meta["files"]))
        try:
            content = self._file(artifact, meta, name)
        except _MALFORMED as error:
            self._metas.drop(artifact)
            raise self._damaged(artifact, meta, error) from error
        self._remote.touch(_used_name(artifact), modified)
        return content

    def made_from(self, artifact: str) -> Address:
        """What an artifact was made from.

        Raises:
            MissingArtifact: It is absent, or its meta.json is damaged.
            Problem: The object store cannot be reached.
        """
        with suppress(MissingArtifact):
            return super().made_from(artifact)
        meta, _ = self._remote_meta(artifact)
        return Address(meta["stage"], meta["version"], meta["inputs"], meta["params"])

    def push(self, address: Address) -> None:
        """Sends an artifact of the cache to the object store, unless it is there.

        Raises:
            MissingArtifact: The cache has no intact copy of it.
            Problem: The object store cannot be reached.
        """
        if self._remote.head(self._key(address.artifact, META)) is None:
            self._send(address.artifact)

    def remove(self, artifact: str) -> None:
        """Removes an artifact from the object store and the cache; does nothing if it is absent."""
        self._metas.drop(artifact)
        self._remove_remote(artifact)
        super().remove(artifact)

    def artifacts(self) -> Iterator[StoredArtifact]:
        """All artifacts of the object store."""
        used = self._remote.used("artifacts")
        for artifact, objects in self._listed().items():
            if META in objects:
                last_used = max(objects[META][1], used.get(_used_name(artifact), 0.0))
                yield StoredArtifact(artifact, sum(size for size, _ in objects.values()), last_used)

    def clean(self, now: float) -> None:
        """Removes what crashes left, here and in the object store: packs without meta.json, notes of what is gone."""
        super().clean(now)
        listed = self._listed()
        for artifact, objects in listed.items():
            packs = {name for name, (_, modified) in objects.items() if now - modified > ORPHAN_SECONDS} - {META}
            if META in objects and len(objects) > 2:
                with suppress(MissingArtifact):
                    packs.discard(self._remote_meta(artifact)[0]["pack"])
            elif META in objects:
                continue
            self._remote.delete([self._key(artifact, name) for name in packs])
        for name in self._remote.used("artifacts"):
            if name.removeprefix("artifacts/") not in listed:
                self._remote.forget(name)

    def cached(self) -> Iterator[StoredArtifact]:
        """Artifacts of the cache."""
        return super().artifacts()

    def drop(self, artifact: str) -> None:
        """Removes the copy of an artifact in the cache."""
        super().remove(artifact)

    def _key(self, artifact: str, name: str) -> str:
        return f"artifacts/{self._folder(artifact).relative_to(self.root).as_posix()}/{name}"

    def _listed(self) -> dict[str, dict[str, tuple[int, float]]]:
        """Artifact -> name of each of its objects -> bytes and time of writing."""
        listed: dict[str, dict[str, tuple[int, float]]] = {}
        for entry in self._remote.list("artifacts"):
            if found := _ARTIFACT_KEY.fullmatch(entry.key):
                stage, key, name = found.groups()
                listed.setdefault(f"{stage}/{key}", {})[name] = (entry.bytes, entry.modified)
        return listed

    def _send(self, artifact: str) -> None:
        folder = super().fetch(artifact)
        meta = read_meta(folder, artifact)
        meta["pack"] = f"pack-{uuid.uuid4().hex}"
        position = 0
        for _, file in sorted(meta["files"].items()):
            file["offset"] = position
            position += file["bytes"]
        pack = self._key(artifact, meta["pack"])
        chunks = _pack_chunks(folder, sorted(meta["files"]))
        self._remote.put(pack, b"".join(chunks) if position <= RANGE_BYTES else chunks)
        if not self._remote.create(self._key(artifact, META), json.dumps(meta, sort_keys=True).encode()):
            self._remote.delete([pack])

    def _download(self, artifact: str) -> Path:
        meta, modified = self._remote_meta(artifact)
        folder = self._temporary / f"{artifact.replace('/', '-')[:40]}-{uuid.uuid4().hex}"
        folder.mkdir()
        try:
            try:
                self._unpack(artifact, meta, folder)
            except _MALFORMED as error:
                raise self._damaged(artifact, meta, error) from error
            (folder / META).write_text(json.dumps(meta, indent=2, sort_keys=True), encoding="utf-8")
            self._keep(folder, artifact)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
        self._remote.touch(_used_name(artifact), modified)
        return self._folder(artifact)

    def _unpack(self, artifact: str, meta: dict[str, Any], folder: Path) -> None:
        """Writes the files of an artifact.

        The pack is read from one end to the other, whatever the sizes of its files.
        """
        files = sorted(meta["files"].items())
        total = sum(int(file["bytes"]) for _, file in files)
        pack = _Reader(self._remote.range(self._key(artifact, meta["pack"]), 0, total))
        for name, file in files:
            path = folder / _checked_name(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            digest = hashlib.sha256()
            with path.open("wb") as stream:
                for chunk in pack.take(file["bytes"]):
                    digest.update(chunk)
                    stream.write(chunk)
            _check_sha256(name, file, digest.hexdigest())

    def _file(self, artifact: str, meta: dict[str, Any], name: str) -> bytes:
        """A file of an artifact in the object store, verified.

        Raises:
            FileNotFoundError: The artifact has no file of that name.
            ValueError: It is damaged, or is not there any more.
        """
        file = meta["files"].get(name)
        if file is None:
            raise FileNotFoundError(f"The artifact {artifact} has no file {name}.")
        content = b"".join(self._file_chunks(artifact, meta, file))
        _check_sha256(name, file, hashlib.sha256(content).hexdigest())
        return content

    def _file_chunks(self, artifact: str, meta: dict[str, Any], file: dict[str, Any]) -> Iterator[bytes]:
        key = self._key(artifact, meta["pack"])
        return self._remote.range(key, file["offset"], file["offset"] + file["bytes"])

    def _remote_meta(self, artifact: str) -> tuple[dict[str, Any], float]:
        found = self._remote.get(self._key(artifact, META))
        if found is None:
            raise MissingArtifact(artifact)
        try:
            return parse_meta(found[0], artifact), found[1]
        except ValueError as error:
            raise self._damaged(artifact, {}, error) from error

    def _damaged(self, artifact: str, meta: dict[str, Any], fault: Exception) -> MissingArtifact:
        """Removes what was found damaged, but not what another process has put in its place meanwhile."""
        found = self._remote.get(self._key(artifact, META))
        if found is not None and _pack_of(found[0]) == meta.get("pack"):
            log.warning("%s is damaged in the object store (%s): removed, and made again.", artifact, fault)
            self._remove_remote(artifact)
        return MissingArtifact(artifact)

    def _remove_remote(self, artifact: str) -> None:
        meta = self._key(artifact, META)
        self._remote.delete([meta])
        self._remote.delete([entry.key for entry in self._remote.list(meta.removesuffix(f"/{META}"))])
        self._remote.forget(_used_name(artifact))


class TieredBlobs(Blobs):
    """Blobs in an object store; those that were stored or read here are in the local cache as well.

    Args:
        root: Folder of the cache.
        remote: The object store.
    """

    def __init__(self, root: Path, remote: Remote) -> None:
        super().__init__(root)
        self._remote = remote

    def size(self, sha256: str) -> int | None:
        """Bytes of the blob in the object store; None if it is absent there. Counts as a use of it."""
        try:
            entry = self._remote.head(self._key(sha256))
        except ValueError:
            return None
        if entry is None:
            return None
        self._remote.touch(self._key(sha256), entry.modified)
        return entry.bytes

    def probe(self) -> None:
        """Makes sure that the cache takes what is written, and that the object store answers.

        Raises:
            Problem: One of them is away.
            OSError: The cache cannot be written, or is full.
        """
        super().probe()
        self._remote.head(self._key("0" * 64))

    def path(self, sha256: str) -> Path:
        """A local file with the blob's verified content, downloaded if need be; to be read only.

        Raises:
            MissingBlob: It is absent, or was damaged and has been removed.
            Problem: The object store cannot be reached.
            OSError: The cache cannot be written.
        """
        try:
            path = super().path(sha256)
        except MissingBlob:
            return self._download(sha256)
        self._remote.touch(self._key(sha256))
        return path

    def remove(self, sha256: str) -> None:
        """Removes a blob from the object store and the cache."""
        self._remote.delete([self._key(sha256)])
        self._remote.forget(self._key(sha256))
        super().remove(sha256)

    def all(self) -> Iterator[tuple[str, int, float]]:
        """All blobs of the object store: sha256, bytes, and last use in seconds since 1970 UTC."""
        used = self._remote.used("blobs")
        for entry in self._remote.list("blobs"):
            yield entry.key.rpartition("/")[2], entry.bytes, max(entry.modified, used.get(entry.key, 0.0))

    def cached(self) -> Iterator[tuple[str, int, float]]:
        """Blobs of the cache, as `all` tells of them."""
        return super().all()

    def drop(self, sha256: str) -> None:
        """Removes the copy of a blob in the cache."""
        super().remove(sha256)

    def append_part(self, upload_id: str, offset: int, data: bytes) -> None:
        """Stores a part of an upload in the object store; the same offset again replaces it."""
        self._remote.put(self._part_key(upload_id, offset), data)

    def discard(self, upload_id: str) -> None:
        """Removes the parts of an upload; does nothing if there are none."""
        self._remote.delete([entry.key for entry in self._remote.list(self._upload_prefix(upload_id))])

    def uploads(self) -> Iterator[tuple[str, float]]:
        """Uploads with parts in the object store, and when the last part came, in seconds since 1970 UTC."""
        last: dict[str, float] = {}
        for entry in self._remote.list("uploads"):
            upload_id = entry.key.split("/")[1]
            last[upload_id] = max(entry.modified, last.get(upload_id, 0.0))
        yield from last.items()

    def _parts(self, upload_id: str) -> Iterator[tuple[int, int]]:
        for entry in self._remote.list(self._upload_prefix(upload_id)):
            yield int(entry.key.rpartition("/")[2]), entry.bytes

    def _part_chunks(self, upload_id: str, chain: list[int], parts: dict[int, int]) -> Iterator[bytes]:
        for offset in chain:
            yield from self._remote.range(self._part_key(upload_id, offset), 0, parts[offset])

    def _keep(self, temporary: Path, sha256: str) -> None:
        size = temporary.stat().st_size
        super()._keep(temporary, sha256)
        if self.size(sha256) != size:
            self._remote.put(self._key(sha256), self._path(sha256))

    def _download(self, sha256: str) -> Path:
        try:
            entry = self._remote.head(self._key(sha256))
        except ValueError:
            entry = None
        if entry is None:
            raise MissingBlob(sha256)
        temporary, digest = self._temporary / f"blob-{uuid.uuid4().hex}", hashlib.sha256()
        try:
            with temporary.open("wb") as stream:
                for chunk in self._remote.range(entry.key, 0, entry.bytes):
                    digest.update(chunk)
                    stream.write(chunk)
            if digest.hexdigest() != sha256:
                log.warning("The blob %s is damaged in the object store: removed.", sha256)
                self._remote.delete([entry.key])
                raise MissingBlob(sha256)
            super()._keep(temporary, sha256)
        finally:
            temporary.unlink(missing_ok=True)
        self._remote.touch(entry.key, entry.modified)
        return self._path(sha256)

    def _key(self, sha256: str) -> str:
        return self._path(sha256).relative_to(self.root).as_posix()

    def _upload_prefix(self, upload_id: str) -> str:
        return self._upload(upload_id).relative_to(self.root).as_posix()

    def _part_key(self, upload_id: str, offset: int) -> str:
        return f"{self._upload_prefix(upload_id)}/{offset:020d}"


_MALFORMED = (ValueError, KeyError, TypeError, AttributeError)
"""What reading a damaged artifact of the object store raises; errors of the disk are not among them."""


class _Reader:
    """Cuts a stream of chunks at sizes of its reader's."""

    def __init__(self, chunks: Iterator[bytes]) -> None:
        self._chunks = chunks
        self._rest = memoryview(b"")

    def take(self, count: int) -> Iterator[memoryview]:
        """The next `count` bytes.

        Raises:
            ValueError: The stream ends before.
        """
        while count > 0:
            if not self._rest:
                chunk = next(self._chunks, None)
                if chunk is None:
                    raise ValueError("the pack is too short")
                self._rest = memoryview(chunk)
            piece, self._rest = self._rest[:count], self._rest[count:]
            count -= len(piece)
            yield piece


def _pack_of(content: bytes) -> object:
    """Name of the pack that a meta.json of the object store refers to; None where it is not valid."""
    try:
        return json.loads(content)["pack"]
    except _MALFORMED:
        return None


def _pack_chunks(folder: Path, names: list[str]) -> Iterator[bytes]:
    for name in names:
        with (folder / name).open("rb") as stream:
            while chunk := stream.read(CHUNK):
                yield chunk


def _checked_name(name: str) -> PurePosixPath:
    path = PurePosixPath(name)
    if not path.parts or path.is_absolute() or ".." in path.parts or "\0" in name:
        raise ValueError(f"{name!r} is not the name of an artifact's file")
    return path


def _check_sha256(name: str, file: dict[str, Any], found: str) -> None:
    if file["sha256"] != found:
        raise ValueError(f"{name} does not match its sha256")


def _used_name(artifact: str) -> str:
    return f"artifacts/{artifact}"
