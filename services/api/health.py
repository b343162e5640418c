"""`/v1/health`: for load balancers and container engines; needs no key."""

from __future__ import annotations

import threading
import time

import sqlalchemy as sa
import structlog
from fastapi import APIRouter, Request, Response

from services.api.answers import Live, Ready
from services.service import Service
from services.tasks import ROLES

_KEPT_SECONDS = 1.0
_NO_BLOB = "0" * 64

router = APIRouter(prefix="/v1/health", tags=["health"])
log = structlog.get_logger("diaphane.health")


class Readiness:
    """Looks at database and store at most once a second, however often it is asked.

    Args:
        service: What is looked at.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self._lock = threading.Lock()
        self._found: tuple[float, Ready] | None = None

    def look(self) -> Ready:
        """Whether requests can be served; a role without a worker is told, and is no reason not to be ready."""
        with self._lock:
            if self._found is None or time.monotonic() - self._found[0] > _KEPT_SECONDS:
                self._found = (time.monotonic(), self._look())
            return self._found[1]

    def _look(self) -> Ready:
        database, store = self._database(), self._store()
        missing: list[str] = list(ROLES)
        if database:
            alive = {role for executor in self._service.jobs.executors() if executor.alive for role in executor.roles}
            missing = [role for role in ROLES if role not in alive]
        status = "ready" if database and store else "unavailable"
        return Ready(status=status, database=database, store=store, missing_roles=missing)

    def _database(self) -> bool:
        try:
            with self._service.database.read() as connection:
                return connection.scalar(sa.select(1)) == 1
        except Exception as error:
            log.warning("database away", error=type(error).__name__)
            return False

    def _store(self) -> bool:
        try:
            self._service.storage.blobs.has(_NO_BLOB)
        except Exception as error:
            log.warning("store away", error=type(error).__name__)
            return False
        return True


@router.get("/live")
async def read_live() -> Live:
    """The process answers."""
    return Live()


@router.get("/ready", responses={503: {"model": Ready, "description": "Database or store do not answer."}})
def read_ready(request: Request, response: Response) -> Ready:
    """Whether requests can be served."""
    readiness: Readiness = request.app.state.readiness
    found = readiness.look()
    response.status_code = 200 if found.status == "ready" else 503
    return found
