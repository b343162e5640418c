"""What names and identifies a bundle: its slug, and the digest over its files."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path

from schemas.bundle import CARD, FILES, MANIFEST
from schemas.canonical import canonical_json, file_sha256
from schemas.problem import Problem
from schemas.service import FileRef

_NAME = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?")


def check_name(name: str) -> str:
    """The name itself, if it can be a bundle's.

    Raises:
        Problem: It is not 1 to 63 small letters, digits and inner hyphens.
    """
    if not _NAME.fullmatch(name):
        raise Problem(
            f"'{name}' cannot be the name of a bundle.",
            "Use 1 to 63 small letters, digits and hyphens, with no hyphen at either end: --name glass.",
        )
    return name


def bundle_files(folder: Path) -> dict[str, FileRef]:
    """The files of a bundle that are there: the manifest and those it may list, whatever else lies beside them."""
    paths = {name: folder / name for name in (MANIFEST, *FILES, CARD)}
    return {
        name: FileRef(sha256=file_sha256(path), bytes=path.stat().st_size)
        for name, path in paths.items()
        if path.is_file()
    }


def digest_of(files: Mapping[str, FileRef]) -> str:
    """Hex sha256 over the sorted names and hashes of a bundle's files."""
    return hashlib.sha256(canonical_json({name: file.sha256 for name, file in files.items()}).encode()).hexdigest()


def bundle_digest(folder: Path) -> str:
    """Hex sha256 over the sorted names and contents of a bundle's files."""
    return digest_of(bundle_files(folder))
