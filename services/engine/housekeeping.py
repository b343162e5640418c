"""Retention, once an hour: of the service by one of the processes that conduct jobs, of a cache by its own process."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import sqlalchemy as sa
import structlog

from schemas.job import FINAL_STATES
from services.database import Database, tables
from services.engine import system
from services.settings import Settings

if TYPE_CHECKING:
    from dbos import DBOSClient

    from services.storage import Storage

PERIOD_SECONDS = 3600.0
FIRST_SECONDS = 60.0
WORKFLOW_SECONDS = 24 * 3600.0
"""DBOS's rows of finished work are kept for so long: only for those who look into the database."""
MOST_WORKFLOWS = 20_000
_MARK = "housekeeping"

log = structlog.get_logger(__name__)


class Housekeeping:
    """Removes what is too old or too much.

    Args:
        settings: Of the service.
        database: The database.
        client: Of the workflows in it.
        storage: Artifacts and blobs.
        conducts: Whether this process conducts jobs.
    """

    def __init__(
        self, settings: Settings, database: Database, client: DBOSClient, storage: Storage, *, conducts: bool
    ) -> None:
        self._settings, self._database, self._client, self._storage = settings, database, client, storage
        self._conducts = conducts
        self._cache_swept = time.monotonic()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="housekeeping")

    def start(self) -> None:
        """Begins; nothing is removed in the first minute."""
        self._thread.start()

    def stop(self) -> None:
        """Ends, after what is being removed."""
        self._end.set()

    def prune(self, older_than: float = WORKFLOW_SECONDS) -> int:
        """Removes DBOS's rows of ended workflows, apart from those of jobs that have not ended.

        Args:
            older_than: Seconds since they ended.

        Returns:
            How many.
        """
        table = system.workflows(self._database)
        before = int((time.time() - older_than) * 1000)
        ended = sa.select(table.c.workflow_uuid).where(
            table.c.status.not_in(system.LIVE), table.c.completed_at < before
        )
        with self._database.read() as connection:
            found = list(connection.scalars(ended.order_by(table.c.completed_at).limit(MOST_WORKFLOWS)))
            running = set(
                connection.scalars(sa.select(tables.jobs.c.id).where(tables.jobs.c.state.not_in(FINAL_STATES)))
            )
        ids = [workflow_id for workflow_id in found if workflow_id.partition(".")[0] not in running]
        system.remove(self._client, ids)
        return len(ids)

    def _run(self) -> None:
        wait = FIRST_SECONDS
        while not self._end.wait(wait):
            wait = FIRST_SECONDS
            try:
                if time.monotonic() - self._cache_swept >= PERIOD_SECONDS:
                    self._cache_swept = time.monotonic()
                    self._sweep_cache()
                if self._conducts and self._due():
                    self._sweep()
            except Exception:
                log.exception("housekeeping failed and is tried again")

    def _due(self) -> bool:
        """Whether it is time, and no other process was first."""
        table, now = tables.meta, time.time()

        def body(connection: sa.Connection) -> bool:
            last = connection.scalar(sa.select(table.c.value).where(table.c.name == _MARK).with_for_update())
            if last is None:
                connection.execute(table.insert().values(name=_MARK, value=str(now)))
                return True
            if now - float(last) < PERIOD_SECONDS:
                return False
            connection.execute(table.update().where(table.c.name == _MARK).values(value=str(now)))
            return True

        return self._database.retry(body)

    def _sweep_cache(self) -> None:
        from services.retention import sweep_cache

        sweep_cache(self._storage, self._settings, time.time())

    def _sweep(self) -> None:
        from services.retention import sweep

        swept = sweep(self._database, self._storage, self._settings, time.time())
        log.info("swept", result=str(swept), workflows=self.prune())
