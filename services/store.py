"""Content-addressed artifacts: what a stage made, found again by what it was made from.

An artifact's address is the sha256 of the canonical JSON of (stage, code version, inputs' keys, parameters). Layout:

    root/<stage>/<key[:2]>/<key>/   files of the artifact and meta.json
    root/tmp/                       being written, or left by a crash; removed when a day old
    root/damaged/                   moved aside because a file did not match its sha256
    root/verified/<stage>-<key>     sizes and times of the files when their sha256 last matched

Rules:
- an artifact is complete or absent: it is written under a temporary name, synced, then renamed;
- of two writers of the same artifact the first wins and the second discards its copy;
- a damaged artifact counts as missing, so the stage makes it again;
- files are hashed when their size or time of change is not what it was when they last matched: finding gigabytes of
  artifacts again takes no reading of them.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import shutil
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

META = "meta.json"
STALE_SECONDS = 24 * 3600.0

log = logging.getLogger(__name__)


def canonical_json(value: Any) -> str:
    """The one text of a JSON value: sorted keys, no spaces, ASCII.

    Raises:
        ValueError: It contains NaN or an infinity.
        TypeError: It contains something that JSON has no form for.
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=True)


def file_sha256(path: Path) -> str:
    """Hex sha256 of a file's bytes."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


@dataclass(frozen=True)
class Address:
    """What an artifact is made from, and thereby where it lies.

    Attributes:
        stage: Name of the stage, a folder name.
        version: Code version of the stage (`services.versions.code_version`).
        inputs: Keys or digests of what the stage reads, in a fixed order.
        params: JSON values that change the result. Paths do not belong here, digests of their content do.
    """

    stage: str
    version: str
    inputs: Sequence[str] = ()
    params: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def key(self) -> str:
        """Hex sha256 of the canonical JSON of all four."""
        parts = [self.stage, self.version, list(self.inputs), dict(self.params)]
        return hashlib.sha256(canonical_json(parts).encode()).hexdigest()


class Store:
    """Artifacts under one folder. Any number of processes may share it.

    Args:
        root: Folder; created if missing.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._temporary = root / "tmp"
        self._verified: set[str] = set()
        self._temporary.mkdir(parents=True, exist_ok=True)
        self._remove_stale()

    def path(self, address: Address) -> Path:
        """Where the artifact is, or would be."""
        return self.root / address.stage / address.key[:2] / address.key

    def has(self, address: Address) -> bool:
        """Whether the artifact is there, without reading its files: for deciding that a stage can be skipped."""
        return (self.path(address) / META).is_file()

    def get(self, address: Address) -> Path | None:
        """The artifact's folder, its files verified (see the rules above); None if missing or damaged."""
        folder = self.path(address)
        if not self.has(address):
            return None
        if address.key not in self._verified:
            before = _signature(folder)
            if before != self._remembered(address):
                fault = _fault(folder, address)
                if fault is not None:
                    self._set_aside(folder, address, fault)
                    return None
                self._remember(address, before)
            self._verified.add(address.key)
        return folder

    @contextmanager
    def put(self, address: Address) -> Iterator[Path]:
        """A temporary folder to write the artifact's files into; it becomes the artifact when the context is left.

        If the body raises, nothing is stored. If another process stored the artifact meanwhile, that one stays.
        """
        folder = self._temporary / f"{address.stage}-{address.key[:8]}-{uuid.uuid4().hex}"
        folder.mkdir()
        try:
            yield folder
            _write_meta(folder, address)
            sync_tree(folder)
            written = _signature(folder)
            if self._commit(folder, self.path(address)):
                self._remember(address, written)
                self._verified.add(address.key)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _commit(self, folder: Path, target: Path) -> bool:
        """Whether this writer's artifact is the one that stays."""
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            folder.rename(target)
        except OSError:
            if not (target / META).is_file():
                raise
            return False
        sync(target.parent)
        return True

    def _remembered(self, address: Address) -> str | None:
        path = self.root / "verified" / f"{address.stage}-{address.key}"
        return path.read_text(encoding="utf-8") if path.is_file() else None

    def _remember(self, address: Address, signature: str) -> None:
        path = self.root / "verified" / f"{address.stage}-{address.key}"
        path.parent.mkdir(exist_ok=True)
        path.write_text(signature, encoding="utf-8")  # a torn one does not match, and costs one more hashing

    def _set_aside(self, folder: Path, address: Address, fault: str) -> None:
        target = self.root / "damaged" / f"{address.stage}-{address.key}-{uuid.uuid4().hex[:8]}"
        target.parent.mkdir(exist_ok=True)
        log.warning("The artifact %s is damaged (%s): moved to %s, and made again.", folder, fault, target)
        try:
            folder.rename(target)
        except FileNotFoundError:
            return  # another process was first to move it

    def _remove_stale(self) -> None:
        for folder in self._temporary.iterdir():
            try:
                age = time.time() - max(path.stat().st_mtime for path in (folder, *folder.rglob("*")))
            except FileNotFoundError:
                continue  # its owner has just committed it
            if age > STALE_SECONDS:
                shutil.rmtree(folder, ignore_errors=True)


def sync(path: Path) -> None:
    """Makes a file's content, or the names in a folder, durable."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def sync_tree(folder: Path) -> None:
    """Makes everything in a folder durable."""
    for path in (*folder.rglob("*"), folder):
        sync(path)


def write_durably(path: Path, text: str) -> None:
    """Replaces a text file in one step: readers see the old or the new one, and a crash leaves one of them."""
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    with temporary.open("w", encoding="utf-8") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    temporary.replace(path)
    sync(path.parent)


def _signature(folder: Path) -> str:
    """Names, sizes and times of change of all files, as one text."""
    stats = ((path, path.stat()) for path in sorted(folder.rglob("*")) if path.is_file())
    return canonical_json([[str(path.relative_to(folder)), stat.st_size, stat.st_mtime_ns] for path, stat in stats])


def _write_meta(folder: Path, address: Address) -> None:
    files = {
        path.relative_to(folder).as_posix(): {"sha256": file_sha256(path), "bytes": path.stat().st_size}
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    meta = {
        "stage": address.stage,
        "version": address.version,
        "inputs": list(address.inputs),
        "params": dict(address.params),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "files": files,
    }
    (folder / META).write_text(json.dumps(meta, indent=2, sort_keys=True, allow_nan=False), encoding="utf-8")


def _fault(folder: Path, address: Address) -> str | None:
    try:
        meta = json.loads((folder / META).read_text(encoding="utf-8"))
        made_from = Address(meta["stage"], meta["version"], meta["inputs"], meta["params"])
        if made_from.key != address.key:
            return f"{META} belongs to another artifact"
        for name, expected in meta["files"].items():
            path = folder / name
            if path.stat().st_size != expected["bytes"] or file_sha256(path) != expected["sha256"]:
                return f"{name} does not match its sha256"
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        return f"{type(error).__name__}: {error}"
    return None
