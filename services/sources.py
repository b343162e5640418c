"""Files that came as blobs, laid out in a folder of their own, so that USD finds them under their names."""

from __future__ import annotations

import os
import shutil
import uuid
from pathlib import Path, PurePosixPath

from schemas.problem import ExitCode, Problem
from services.storage import Blobs
from services.store import sync_tree
from services.tasks import Source


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
    try:
        for name, sha256 in source.files.items():
            target = temporary / _checked(name)
            target.parent.mkdir(parents=True, exist_ok=True)
            # A copy, not a link: what a reader does to it must not reach the blob.
            shutil.copyfile(blobs.path(sha256), target)
            target.chmod(0o444)
        temporary.mkdir(parents=True, exist_ok=True)
        sync_tree(temporary)
        temporary.rename(folder)
    except OSError:
        if not folder.is_dir():  # another process may have been first
            raise
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return folder


def _checked(name: str) -> PurePosixPath:
    path = PurePosixPath(name)
    if path.is_absolute() or not path.parts or ".." in path.parts or "\\" in name or "\0" in name:
        raise Problem(f"'{name}' cannot be the name of a scene's file.", "Use relative names.", ExitCode.USAGE)
    return path
