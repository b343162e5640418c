"""A child's room: the folders that are all it sees of the service's files, filled for one task at a time.

    empty/                  where it works, so that a relative path leads nowhere; nothing is ever in it
    needs/<stage>/<key>/    artifacts that the task reads
    sources/<digest>/       files of the scene or the bundle that the task reads
    made/                   where it writes its artifact, laid out as a store
    tmp/                    its temporary files

The kernel's rules are bound to these folders when the process begins. What is in them changes with every task: links to
files that the service has verified, so that nothing is copied where both lie on one file system.
"""

from __future__ import annotations

import errno
import fcntl
import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from stages.store import META, Address, MissingArtifact, Store, remove_tree

KERNELS = "kernels"
"""Folder of what numba compiled, beside the folders of processes."""
_LOCK = ".lock"


class Room:
    """The folders of one child.

    Args:
        folder: Holds them.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.empty, self.needs, self.sources = folder / "empty", folder / "needs", folder / "sources"
        self.made, self.tmp = folder / "made", folder / "tmp"
        self._id: int | None = None

    @property
    def readable(self) -> tuple[Path, ...]:
        """What its process may read."""
        return self.empty, self.needs, self.sources

    @property
    def writable(self) -> tuple[Path, ...]:
        """Where its process may write; temporary files first."""
        return self.tmp, self.made

    def open(self) -> None:
        """Makes the folders anew, before the process begins."""
        self.close()
        for folder in (*self.readable, *self.writable):
            folder.mkdir(parents=True)
        # Where the kernel has no Landlock nobody else keeps it empty.
        self.empty.chmod(0o555)
        self._id = self.folder.stat().st_ino

    def is_open(self) -> bool:
        """Whether the folders are those that the process was given: a volume may go away and come back."""
        try:
            return self._id is not None and self.folder.stat().st_ino == self._id and self.needs.is_dir()
        except OSError:
            return False

    def fill(self, needs: Mapping[str, Path], sources: Mapping[str, Path]) -> None:
        """Puts in what a task reads, and takes out what the task before it read and wrote.

        Args:
            needs: Folders of artifacts by `stage/key`.
            sources: Folders of sources by digest.
        """
        self.clear()
        for name, folder in needs.items():
            link_tree(folder, self.needs / name)
        for name, folder in sources.items():
            link_tree(folder, self.sources / name)

    def clear(self) -> None:
        """Takes everything out but what the process may keep for itself until it ends."""
        for folder in (self.needs, self.sources, self.made):
            with suppress(FileNotFoundError):
                for entry in folder.iterdir():
                    if entry.name != "tmp":
                        remove_tree(entry)

    def artifact(self, address: Address) -> Path:
        """Where the process leaves an artifact."""
        return self.made / address.stage / address.key[:2] / address.key

    def close(self) -> None:
        """Removes everything."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self._id = None


class RoomStore(Store):
    """What a child knows of the store: the artifacts in its room, which its worker has verified.

    Args:
        room: Folder of the room.
        checkpoints: See `Store.checkpoints`.
    """

    def __init__(self, room: Path, checkpoints: Path) -> None:
        super().__init__(room / "made")
        self._needs, self.checkpoints = room / "needs", checkpoints

    def fetch(self, artifact: str) -> Path:
        """The folder of an artifact that the task needs.

        Raises:
            MissingArtifact: The task does not need it.
        """
        folder = self._needs / artifact
        if not (folder / META).is_file():
            raise MissingArtifact(artifact)
        return folder

    def _keep(self, folder: Path, artifact: str) -> None:
        """The worker takes it from here, and makes it durable."""
        target = self._folder(artifact)
        target.parent.mkdir(parents=True, exist_ok=True)
        folder.rename(target)


def link_tree(source: Path, target: Path) -> None:
    """Makes every file of a folder known under another one as well; copies where it cannot be linked."""
    for parent, _, files in os.walk(source):
        here = target / Path(parent).relative_to(source)
        here.mkdir(parents=True, exist_ok=True)
        for name in files:
            try:
                os.link(Path(parent, name), here / name, follow_symlinks=False)
            except OSError as error:
                if error.errno not in (errno.EXDEV, errno.EPERM, errno.EMLINK, errno.ENOTSUP):
                    raise
                shutil.copy2(Path(parent, name), here / name, follow_symlinks=False)


class Scratch:
    """The folder of one process's rooms. Those of processes that were killed are removed by whoever comes next.

    A process holds a lock on its folder for as long as it lives, however it ends: so no process id has to be believed,
    which another process, or one in another container, may have by now.

    Args:
        root: Folder of all processes' folders.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        root.mkdir(parents=True, exist_ok=True)
        with _locked(root / _LOCK):  # nobody takes a folder away between its making and its locking
            self.folder = root / f"{os.getpid()}-{uuid.uuid4().hex[:8]}"
            self.folder.mkdir()
            self._lock: IO[bytes] = (self.folder / _LOCK).open("wb")
            fcntl.flock(self._lock, fcntl.LOCK_EX)
        self.sweep()

    def sweep(self) -> int:
        """Removes the folders of processes that are gone; how many."""
        removed = 0
        with _locked(self._root / _LOCK):
            for folder in self._root.iterdir():
                if folder.is_dir() and folder.name != KERNELS and folder != self.folder and _is_abandoned(folder):
                    shutil.rmtree(folder, ignore_errors=True)
                    removed += 1
        return removed

    def close(self) -> None:
        """Removes the folder."""
        shutil.rmtree(self.folder, ignore_errors=True)
        self._lock.close()


def _is_abandoned(folder: Path) -> bool:
    try:
        with (folder / _LOCK).open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except FileNotFoundError:
        return True
    return True


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    with path.open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
