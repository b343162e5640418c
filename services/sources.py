"""Files that came as blobs, laid out in a folder of their own, so that USD finds them under their names."""

from __future__ import annotations

import fcntl
import os
import shutil
import uuid
from contextlib import suppress
from pathlib import Path, PurePosixPath

from schemas.problem import ExitCode, Problem
from services.storage import Blobs
from stages.store import sync_tree
from stages.tasks import Source

YOUNG_SECONDS = 60.0
"""A folder may be so old before it is locked by whoever makes it."""


def materialise(source: Source, blobs: Blobs, cache: Path) -> Path:
    """The folder with a source's files; made once, then found.

    Args:
        source: What to lay out.
        blobs: Where its files come from.
        cache: Folder of such folders.

    Raises:
        Problem: A name leads out of the folder.
    """
    if source.folder is not None:
        return Path(source.folder)
    folder = cache / "sources" / source.digest
    if folder.is_dir():
        os.utime(folder)
        return folder
    temporary = cache / "sources" / f".{source.digest}-{uuid.uuid4().hex}"
    temporary.mkdir(parents=True)
    living = os.open(temporary, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(living, fcntl.LOCK_EX)  # until it is made, or its process ends, however that ends
        for name, sha256 in source.files.items():
            target = temporary / _checked(name)
            target.parent.mkdir(parents=True, exist_ok=True)
            # A copy, not a link: what a reader does to it must not reach the blob.
            shutil.copyfile(blobs.path(sha256), target)
            target.chmod(0o444)
        sync_tree(temporary)
        temporary.rename(folder)
    except OSError:
        if not folder.is_dir():  # another process may have been first
            raise
    finally:
        os.close(living)
        shutil.rmtree(temporary, ignore_errors=True)
    return folder


def sweep_sources(cache: Path, now: float) -> int:
    """Removes what processes left that were killed while they laid files out; how many folders.

    Args:
        cache: As in `materialise`.
        now: Seconds since 1970 UTC.
    """
    removed = 0
    for folder in (cache / "sources").glob(".*-*"):
        with suppress(OSError):  # it was finished meanwhile, or another process is at it
            if now - folder.stat().st_ctime < YOUNG_SECONDS:
                continue
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            finally:
                os.close(handle)
            shutil.rmtree(folder, ignore_errors=True)
            removed += 1
    return removed


def _checked(name: str) -> PurePosixPath:
    path = PurePosixPath(name)
    if path.is_absolute() or not path.parts or ".." in path.parts or "\\" in name or "\0" in name:
        raise Problem(f"'{name}' cannot be the name of a scene's file.", "Use relative names.", ExitCode.USAGE)
    return path
