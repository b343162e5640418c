"""Local folders with the files of published versions, for those that read bundles from a folder."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Mapping
from pathlib import Path

from schemas.canonical import file_sha256
from schemas.service import FileRef
from services.registry.records import PUBLICATION, Publication
from services.storage import Blobs
from stages.store import sync, sync_tree


def check_out(folder: Path, publication: Publication, files: Mapping[str, FileRef], blobs: Blobs) -> Path:
    """Makes sure that a folder holds a version's files, and nothing but them and `publication.json`.

    Args:
        folder: Where they belong.
        publication: The version.
        files: Name -> size and hash.
        blobs: Where they come from; only read if the folder is not there or was damaged.

    Returns:
        The folder.

    Raises:
        MissingBlob: A file is no longer in the store.
        OSError: The folder cannot be written.
    """
    if _is_intact(folder, files):
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = folder.with_name(f".{folder.name}-{uuid.uuid4().hex}")
    temporary.mkdir()
    try:
        for name, reference in files.items():
            shutil.copyfile(blobs.path(reference.sha256), temporary / name)
        (temporary / PUBLICATION).write_text(publication.model_dump_json(indent=2), encoding="utf-8")
        sync_tree(temporary)
        _put_in_place(temporary, folder, files)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return folder


def _put_in_place(temporary: Path, folder: Path, files: Mapping[str, FileRef]) -> None:
    try:
        temporary.rename(folder)
    except OSError:
        if _is_intact(folder, files):  # another process was faster
            return
        damaged = folder.with_name(f".{folder.name}-damaged-{uuid.uuid4().hex}")
        folder.rename(damaged)
        temporary.rename(folder)
        shutil.rmtree(damaged, ignore_errors=True)
    sync(folder.parent)


def _is_intact(folder: Path, files: Mapping[str, FileRef]) -> bool:
    try:
        if {path.name for path in folder.iterdir()} != {*files, PUBLICATION}:
            return False
        return all(file_sha256(folder / name) == reference.sha256 for name, reference in files.items())
    except OSError:
        return False
