"""Rows of the table of versions: what a new one has, and what one says."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import sqlalchemy as sa

from schemas.service import FileRef
from services.clock import iso
from services.database.tables import versions
from services.registry.records import Publication
from services.registry.signing import SigningKey, statement


def signed_columns(
    connection: sa.Connection, key: SigningKey, name: str, digest: str, files: Mapping[str, FileRef]
) -> dict[str, Any]:
    """Columns of a new version, the next one of its name, that its signature covers."""
    last = connection.scalar(sa.select(sa.func.max(versions.c.ordinal)).where(versions.c.name == name))
    ordinal = 0 if last is None else last + 1
    version, created = f"1.{ordinal}.0", int(time.time())
    text = statement(name, version, digest, iso(created), files)
    return {
        "name": name,
        "version": version,
        "ordinal": ordinal,
        "digest": digest,
        "files": {file: reference.model_dump() for file, reference in files.items()},
        "statement": text,
        "signature": key.sign(text),
        "public_key": key.public_key,
        "created": float(created),
    }


def publication_of(row: Any) -> Publication:
    """The version that a row is."""
    return Publication(
        name=row.name,
        version=row.version,
        digest=row.digest,
        score=row.score,
        evaluation=row.evaluation,
        created=iso(row.created),
    )


def files_of(row: Any) -> dict[str, FileRef]:
    """Name -> size and hash of a row's files."""
    return {name: FileRef.model_validate(reference) for name, reference in row.files.items()}
