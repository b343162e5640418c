"""The application: routes, the key that nearly all of them need, errors, and what is around them."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from importlib.metadata import version

from anyio import to_thread
from fastapi import APIRouter, Depends, FastAPI

from services import dashboard
from services.api import errors
from services.api.description import document_text
from services.api.feeds import Feeds
from services.api.health import Readiness
from services.api.leases import Leases
from services.api.metrics import Metrics
from services.api.observe import LOOPBACK, Observe
from services.api.parameters import require_known
from services.api.routes import GUARDED, OPEN, routes, scope_of
from services.api.security import Guard
from services.dashboard import OPEN_PAGES, PAGES, SESSION_ANSWERS, refusals
from services.service import Service

THREADS = 48
"""Requests that are worked on at once; more wait."""


def create_app(service: Service, *, hosts: Sequence[str] = LOOPBACK) -> FastAPI:
    """The application.

    Args:
        service: What it answers from.
        hosts: Names that it answers for in the header `Host`, without port; `*`: any.
    """
    app = FastAPI(
        title="Diaphane",
        version=version("diaphane"),
        openapi_url=None,  # it is a route of its own
        docs_url=None,  # they load scripts from elsewhere
        redoc_url=None,
        redirect_slashes=False,
        lifespan=_lifespan,
    )
    for route in routes((*GUARDED, *PAGES, *SESSION_ANSWERS)):
        scope_of(route)  # a route that forgot to say which scope it needs is found here, not by a stranger
    settings = service.settings
    feeds = Feeds(service.database)
    app.state.service = service
    app.state.feeds = feeds
    app.state.document = document_text
    app.state.metrics = Metrics(service, feeds)
    app.state.readiness = Readiness(service)
    app.state.guard = guard = Guard(service.keys, settings.rate, settings.burst, service.database)
    app.state.routers = (*GUARDED, *OPEN, *PAGES, *SESSION_ANSWERS, *OPEN_PAGES)

    root = APIRouter(dependencies=[Depends(guard), Depends(require_known)])
    for router in GUARDED:
        root.include_router(router)
    app.include_router(root)
    for router in OPEN:
        app.include_router(router, dependencies=[Depends(require_known)])
    dashboard.install(app, service)
    app.state.leases = Leases(service.keys.valid, app.state.sessions.valid)
    errors.install(app, refusals.answer)
    app.add_middleware(
        Observe,
        metrics=app.state.metrics,
        answer=refusals.answer,
        hosts=hosts,
        window=settings.burst / settings.rate,
        burst=settings.burst,
        note_full=app.state.readiness.note_full,
    )
    return app


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    to_thread.current_default_thread_limiter().total_tokens = THREADS
    yield
    app.state.feeds.close()
    await to_thread.run_sync(app.state.guard.settle)
