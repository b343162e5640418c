"""The state folder of one user: database, artifacts and registry without a server."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from services.database import Database, open_database
from services.registry import Registry, open_registry
from services.settings import Settings
from services.storage import Storage, open_storage


@dataclass(frozen=True, slots=True)
class Local:
    """What lies in a state folder."""

    database: Database
    storage: Storage
    registry: Registry


@contextmanager
def open_local(state: Path) -> Iterator[Local]:
    """Opens a state folder; it knows itself only, whatever server the environment names.

    Args:
        state: The folder; made if it is missing.
    """
    settings = Settings(state=state, database="", store="", cache="")
    database = open_database(settings.database_url)
    try:
        storage = open_storage(settings)
        yield Local(database, storage, open_registry(database, storage.blobs, settings))
    finally:
        database.close()
