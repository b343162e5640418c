"""Content-addressed artifacts: what a stage made, found again by what it was made from.

An artifact's address is the sha256 of the canonical JSON of (stage, code version, inputs' keys, parameters). Layout:

    root/<stage>/<key[:2]>/<key>/   files of the artifact and meta.json; the folder's own time is that of its last use
    root/tmp/                       being written, or left by a crash; removed when a day old
    root/damaged/                   moved aside because a file did not match its sha256
    root/verified/<stage>-<key>     sizes and times of the files when their sha256 last matched

`services.storage` puts an object store behind it, for workers on several machines. Rules:
- an artifact is complete or absent: it is written under a temporary name, synced, then renamed;
- of two writers of the same artifact the first wins and the second discards its copy;
- a damaged artifact counts as missing, so the stage makes it again;
- files are hashed when their size or time of change is not what it was when they last matched: finding gigabytes of
  artifacts again takes no reading of them.
"""

from __future__ import annotations

import errno
import hashlib
import json
import logging
import os
import re
import shutil
import stat
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from schemas.canonical import canonical_json, file_sha256
from schemas.problem import ExitCode, Problem

META = "meta.json"
STALE_SECONDS = 24 * 3600.0
DAMAGED_SECONDS = 7 * STALE_SECONDS
TOUCH_SECONDS = 600.0
"""A use is not written down when another one was, less than this long ago."""

_ARTIFACT = re.compile(r"[a-z][a-z0-9-]{0,31}/[0-9a-f]{64}")

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Address:
    """What an artifact is made from, and thereby where it lies.

    Attributes:
        stage: Name of the stage, a folder name.
        version: Of the code of the stage (`stages.closure.Tree.version`).
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

    @property
    def artifact(self) -> str:
        """`stage/key`, the artifact's name outside this process."""
        return f"{self.stage}/{self.key}"


class StoreAway(Problem):
    """The store does not answer: another try may end well.

    Args:
        title: See `Problem`.
        remedy: See `Problem`.
    """

    def __init__(self, title: str, remedy: str) -> None:
        super().__init__(title, remedy, ExitCode.TRY_AGAIN)


class MissingArtifact(Exception):
    """An artifact is absent or was damaged, so that it has to be made again.

    Args:
        artifact: `stage/key`.
    """

    def __init__(self, artifact: str) -> None:
        super().__init__(artifact)
        self.artifact = artifact


@dataclass(frozen=True)
class StoredArtifact:
    """An artifact as retention sees it.

    Attributes:
        artifact: `stage/key`.
        bytes: Of its files.
        last_used: Seconds since 1970 UTC.
    """

    artifact: str
    bytes: int
    last_used: float


class Store:
    """Artifacts under one folder. Any number of processes may share it.

    Args:
        root: Folder; created if missing.

    Attributes:
        root: The folder.
        checkpoints: Folder of what interrupted trainings on this machine go on from.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.checkpoints = root.parent / "checkpoints"
        self._temporary = root / "tmp"
        self._temporary.mkdir(parents=True, exist_ok=True)
        self._clear_temporary(time.time())

    def path(self, address: Address) -> Path:
        """Where the artifact is, or would be."""
        return self._folder(address.artifact)

    def has(self, address: Address) -> bool:
        """Whether the artifact is there, without reading its files: for deciding that a stage can be skipped."""
        return self.holds(address.artifact)

    def get(self, address: Address) -> Path | None:
        """The artifact's folder, its files verified (see the rules above); None if missing or damaged."""
        try:
            return self.fetch(address.artifact)
        except MissingArtifact:
            return None

    def fetch(self, artifact: str) -> Path:
        """The local folder of an artifact, its files verified.

        Args:
            artifact: `stage/key`.

        Raises:
            MissingArtifact: It is absent, or was damaged and has been moved aside.
        """
        folder = self._folder(artifact)
        if not (folder / META).is_file():
            raise MissingArtifact(artifact)
        try:
            before = _signature(folder)
        except FileNotFoundError:  # removed meanwhile
            raise MissingArtifact(artifact) from None
        if before != self._remembered(artifact):
            fault = _fault(folder, artifact)
            if fault is not None:
                self._set_aside(artifact, fault)
                raise MissingArtifact(artifact)
            self._remember(artifact, before)
        _touch(folder)
        return folder

    def holds(self, artifact: str) -> bool:
        """Whether the artifact `stage/key` is there, without reading its files; counts as a use of it."""
        folder = self._folder(artifact)
        if not (folder / META).is_file():
            return False
        _touch(folder)
        return True

    def read(self, artifact: str, name: str) -> bytes:
        """The verified content of one small file of the artifact `stage/key`.

        Raises:
            MissingArtifact: The artifact is absent, or was damaged and has been moved aside.
            FileNotFoundError: The artifact has no file of that name.
        """
        folder = self._folder(artifact)
        if not (folder / META).is_file():
            raise MissingArtifact(artifact)
        try:
            expected = read_meta(folder, artifact)["files"].get(name)
            content = b"" if expected is None else (folder / name).read_bytes()
            if expected is not None and hashlib.sha256(content).hexdigest() != expected["sha256"]:
                raise ValueError(f"{name} does not match its sha256")
        except _DAMAGE as error:
            self._set_aside(artifact, f"{type(error).__name__}: {error}")
            raise MissingArtifact(artifact) from error
        if expected is None:
            raise FileNotFoundError(f"The artifact {artifact} has no file {name}.")
        _touch(folder)
        return content

    def made_from(self, artifact: str) -> Address:
        """What the artifact `stage/key` was made from: whoever knows its name can go on to what it read.

        Raises:
            MissingArtifact: It is absent, or its meta.json is damaged.
        """
        try:
            meta = read_meta(self._folder(artifact), artifact)
        except (OSError, ValueError) as error:
            raise MissingArtifact(artifact) from error
        return Address(meta["stage"], meta["version"], meta["inputs"], meta["params"])

    def push(self, address: Address) -> None:
        """Makes a local artifact known to the other machines: nothing to do where all share this folder."""

    def remove(self, artifact: str) -> None:
        """Removes the artifact `stage/key`, in one step for its readers; does nothing if it is absent."""
        grave = self._temporary / f"removed-{uuid.uuid4().hex}"
        try:
            self._folder(artifact).rename(grave)
        except FileNotFoundError:
            return
        self._memory(artifact).unlink(missing_ok=True)
        shutil.rmtree(grave, ignore_errors=True)

    def artifacts(self) -> Iterator[StoredArtifact]:
        """All artifacts."""
        for meta in self.root.glob(f"*/??/*/{META}"):
            folder = meta.parent
            artifact = f"{folder.parent.parent.name}/{folder.name}"
            if not _ARTIFACT.fullmatch(artifact):
                continue
            try:
                yield StoredArtifact(artifact, _total_bytes(folder), folder.stat().st_mtime)
            except FileNotFoundError:
                continue  # removed meanwhile

    def cached(self) -> Iterator[StoredArtifact]:
        """Local copies of artifacts that lie in an object store: none here."""
        return iter(())

    def drop(self, artifact: str) -> None:
        """Removes the local copy of an artifact that lies in an object store."""

    def clean(self, now: float) -> None:
        """Removes what crashes left more than a day ago, and what was moved aside more than a week ago.

        Args:
            now: Seconds since 1970 UTC.
        """
        self._clear_temporary(now)
        for entry in (self.root / "damaged").glob("*"):
            with suppress(FileNotFoundError):  # another process was first
                if now - entry.stat().st_ctime > DAMAGED_SECONDS:
                    remove_tree(entry)

    @contextmanager
    def put(self, address: Address) -> Iterator[Path]:
        """A temporary folder to write the artifact's files into; it becomes the artifact when the context is left.

        If the body raises, nothing is stored. If another process stored the artifact meanwhile, that one stays.
        """
        with self._written(f"{address.stage}-{address.key[:8]}") as folder:
            yield folder
            _write_meta(folder, address)
            self._keep(folder, address.artifact)

    def adopt(self, folder: Path, artifact: str) -> None:
        """Takes an artifact over that a less trusted process wrote into a folder of its own.

        Args:
            folder: Holds the artifact; it is moved, or stays if another process stored the artifact meanwhile.
            artifact: `stage/key`.

        Raises:
            ValueError: It is not this artifact, whole and of plain files: whoever reads it follows no links.
            OSError: The store cannot be written.
        """
        present = _plain_files(folder)
        if META not in present or present - {META} != set(read_meta(folder, artifact)["files"]):
            raise ValueError(f"What was made is no whole artifact {artifact}.")
        try:
            self._keep(folder, artifact)
        except OSError as error:
            if error.errno != errno.EXDEV:
                raise
            with self._written(artifact.replace("/", "-")) as copy:
                shutil.copytree(folder, copy, symlinks=True, dirs_exist_ok=True)
                self._keep(copy, artifact)

    @contextmanager
    def _written(self, name: str) -> Iterator[Path]:
        """A temporary folder on the store's own file system."""
        folder = self._temporary / f"{name}-{uuid.uuid4().hex}"
        folder.mkdir(parents=True)  # the store may have gone away and come back empty
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _clear_temporary(self, now: float) -> None:
        for entry in self._temporary.iterdir():
            try:
                age = now - max(path.stat().st_mtime for path in (entry, *entry.rglob("*")))
            except FileNotFoundError:
                continue  # its owner has just committed it
            if age > STALE_SECONDS:
                remove_tree(entry)

    def _keep(self, folder: Path, artifact: str) -> None:
        """Moves a complete temporary folder to where its artifact belongs, unless another one is there already."""
        sync_tree(folder)
        written = _signature(folder)
        target = self._folder(artifact)
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            folder.rename(target)
        except OSError:
            if not (target / META).is_file():
                raise
            return
        sync(target.parent)
        self._remember(artifact, written)

    def _folder(self, artifact: str) -> Path:
        if not _ARTIFACT.fullmatch(artifact):
            raise ValueError(f"'{artifact}' does not name an artifact: it is STAGE/KEY.")
        stage, _, key = artifact.partition("/")
        return self.root / stage / key[:2] / key

    def _memory(self, artifact: str) -> Path:
        return self.root / "verified" / artifact.replace("/", "-")

    def _remembered(self, artifact: str) -> str | None:
        try:
            return self._memory(artifact).read_text(encoding="utf-8")
        except FileNotFoundError:
            return None

    def _remember(self, artifact: str, signature: str) -> None:
        path = self._memory(artifact)
        with suppress(OSError):  # a torn or missing one does not match, and costs one more hashing
            path.parent.mkdir(exist_ok=True)
            path.write_text(signature, encoding="utf-8")

    def _set_aside(self, artifact: str, fault: str) -> None:
        folder = self._folder(artifact)
        target = self.root / "damaged" / f"{artifact.replace('/', '-')}-{uuid.uuid4().hex[:8]}"
        target.parent.mkdir(exist_ok=True)
        log.warning("The artifact %s is damaged (%s): moved to %s, and made again.", folder, fault, target)
        try:
            folder.rename(target)
        except FileNotFoundError:
            return  # another process was first to move it


def remove_tree(path: Path) -> None:
    """Removes a file, or a folder with all that is in it, as far as that can be done."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


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


def _plain_files(folder: Path) -> set[str]:
    """Relative names of the files in a folder.

    Raises:
        ValueError: Something in it is a link, a pipe or a device.
    """
    found = set()
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(parent, name)
            mode = path.lstat().st_mode
            if stat.S_ISREG(mode):
                found.add(path.relative_to(folder).as_posix())
            elif not stat.S_ISDIR(mode):
                raise ValueError("What was made has more than plain files in it.")
    return found


def _signature(folder: Path) -> str:
    """Names, sizes and times of change of all files, as one text."""
    found = ((path, path.stat()) for path in sorted(folder.rglob("*")) if path.is_file())
    return canonical_json([[str(path.relative_to(folder)), now.st_size, now.st_mtime_ns] for path, now in found])


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


_DAMAGE = (OSError, ValueError, KeyError, TypeError, AttributeError)
"""What reading an artifact raises whose files or meta.json are not as they were written."""


def read_meta(folder: Path, artifact: str) -> dict[str, Any]:
    """`meta.json` of an artifact's folder.

    Raises:
        OSError: It cannot be read.
        ValueError: It is not the meta.json of that artifact.
    """
    return parse_meta((folder / META).read_bytes(), artifact)


def parse_meta(content: bytes, artifact: str) -> dict[str, Any]:
    """The content of a `meta.json`.

    Raises:
        ValueError: It is not the meta.json of that artifact.
    """
    try:
        meta: dict[str, Any] = json.loads(content)
        made_from = Address(meta["stage"], meta["version"], meta["inputs"], meta["params"])
        named = made_from.artifact == artifact and isinstance(meta["files"], dict)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{META} is not valid ({type(error).__name__}: {error})") from error
    if not named:
        raise ValueError(f"{META} belongs to another artifact")
    return meta


def _fault(folder: Path, artifact: str) -> str | None:
    try:
        for name, expected in read_meta(folder, artifact)["files"].items():
            path = folder / name
            if path.stat().st_size != expected["bytes"] or file_sha256(path) != expected["sha256"]:
                return f"{name} does not match its sha256"
    except _DAMAGE as error:
        return f"{type(error).__name__}: {error}"
    return None


def _touch(folder: Path) -> None:
    """Writes down a use: the time of the folder, which changes neither its files nor what is remembered of them."""
    with suppress(OSError):  # a store that can only be read is used all the same
        if time.time() - folder.stat().st_mtime > TOUCH_SECONDS:
            os.utime(folder)


def _total_bytes(folder: Path) -> int:
    content = (folder / META).read_bytes()
    try:
        return len(content) + sum(int(entry["bytes"]) for entry in json.loads(content)["files"].values())
    except (ValueError, KeyError, TypeError, AttributeError):
        return len(content)
