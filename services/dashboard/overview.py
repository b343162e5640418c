"""`/`: what runs, what is best, who works, and what did not have to be done."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Request, Response

from services.api.parts import Services
from services.api.streams import EventStream
from services.dashboard.figures import champions, lately_ended, role_loads, savings, under_way
from services.dashboard.live import Watch
from services.dashboard.page import PageRoute, render

router = APIRouter(route_class=PageRoute, include_in_schema=False)

_RUNNING = 20
_WAITING = 10
_ENDED = 6
_CHAMPIONS = 12


@router.get("/", response_class=Response)
def show_overview(request: Request, service: Services) -> Response:
    """The page."""
    watch: Watch = request.app.state.watch
    seen = watch.look()  # before the rest is: what changes meanwhile is told
    jobs = service.jobs
    running = [*jobs.list(state="running", limit=_RUNNING), *jobs.list(state="cancelling", limit=_RUNNING)]
    counts = under_way(service.database)
    return render(
        request,
        "overview",
        seen=seen,
        running=running,
        running_count=counts["running"] + counts["cancelling"],
        waiting=jobs.list(state="queued", limit=_WAITING),
        waiting_count=counts["queued"],
        ended=lately_ended(service.database, _ENDED),
        roles=role_loads(jobs.queues(), jobs.executors()),
        champions=champions(service.database, _CHAMPIONS),
        saved=savings(service.database),
    )


@router.get("/changes", response_class=Response)
async def stream_changes(request: Request, seen: Annotated[str, Query(pattern=r"^[0-9a-f]{0,16}$")] = "") -> Response:
    """Server-sent events: something on the page has changed since it was made."""
    watch: Watch = request.app.state.watch
    return EventStream(watch.changes(seen, request.app.state.feeds))
