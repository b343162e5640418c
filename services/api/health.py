"""`/v1/health`: for load balancers and container engines; needs no key."""

from __future__ import annotations

import threading
import time

import sqlalchemy as sa
import structlog
from fastapi import APIRouter, Request, Response

from services.api.answers import Live, Ready
from services.service import Service
from services.storage.blobs import LEAST_FREE_BYTES
from stages.tasks import ROLES

_KEPT_SECONDS = 1.0
_PATIENCE_SECONDS = 2.0
_FULL_SECONDS = 10.0

router = APIRouter(prefix="/v1/health", tags=["health"])
log = structlog.get_logger("diaphane.health")


class Readiness:
    """Looks at database and store at most once a second, however often it is asked.

    Whoever asks while a look takes long is told that they do not answer: a store that hangs must not hold the threads
    that requests need.

    Args:
        service: What is looked at.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self._lock = threading.Lock()
        self._found: tuple[float, Ready] | None = None
        self._full = float("-inf")

    def look(self) -> Ready:
        """Whether requests can be served; a role without a worker is told, and is no reason not to be ready."""
        if not self._lock.acquire(timeout=_PATIENCE_SECONDS):
            return Ready(status="unavailable", database=False, store=False, missing_roles=[])
        try:
            if self._found is None or time.monotonic() - self._found[0] > _KEPT_SECONDS:
                self._found = (time.monotonic(), self._look())
            return self._found[1]
        finally:
            self._lock.release()

    def note_full(self) -> None:
        """A request met a disk or a quota that is full: nothing is ready for a while, whatever a look finds."""
        self._full = time.monotonic()
        self._found = None

    def _look(self) -> Ready:
        database, store = self._database(), self._store()
        missing: list[str] = list(ROLES)
        if database:
            alive = {role for executor in self._service.jobs.executors() if executor.alive for role in executor.roles}
            missing = [role for role in ROLES if role not in alive]
        status = "ready" if database and store and not self._was_full() else "unavailable"
        return Ready(status=status, database=database, store=store, missing_roles=missing)

    def _database(self) -> bool:
        try:
            with self._service.database.read() as connection:
                answers = connection.scalar(sa.select(1)) == 1
            return answers and self._service.database.free_bytes() >= LEAST_FREE_BYTES
        except Exception as error:
            log.warning("database away", error=type(error).__name__)
            return False

    def _store(self) -> bool:
        try:
            self._service.storage.blobs.probe()
        except Exception as error:
            log.warning("store away", error=type(error).__name__)
            return False
        return True

    def _was_full(self) -> bool:
        return time.monotonic() - self._full < _FULL_SECONDS


@router.get("/live")
async def read_live() -> Live:
    """The process answers."""
    return Live()


@router.get("/ready", responses={503: {"model": Ready, "description": "Database or store do not answer, or are full."}})
def read_ready(request: Request, response: Response) -> Ready:
    """Whether requests can be served."""
    readiness: Readiness = request.app.state.readiness
    found = readiness.look()
    response.status_code = 200 if found.status == "ready" else 503
    return found
