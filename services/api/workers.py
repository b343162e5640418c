"""`/v1/workers`: what waits, and who works."""

from __future__ import annotations

from fastapi import APIRouter

from services.api.answers import Workers
from services.api.parts import Services

router = APIRouter(prefix="/v1/workers", tags=["workers"])


@router.get("")
def read_workers(service: Services) -> Workers:
    """Queues by role, and the processes that run work."""
    return Workers(queues=service.jobs.queues(), executors=service.jobs.executors())
