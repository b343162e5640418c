"""What people see of the service: pages made by the server, from the same code as the API.

A browser signs in with an API key and gets a session; the key's scopes decide what the pages offer. Scripts only
refresh parts of pages and show values of charts: everything works without them.
"""

from fastapi import APIRouter, Depends, FastAPI

from services.dashboard import (
    assets,
    clients,
    compare,
    demo,
    examples,
    jobs,
    models,
    overview,
    reference,
    scenes,
    sign_in,
    sign_out,
    webhooks,
)
from services.dashboard.live import Watch
from services.dashboard.sessions import Sessions
from services.dashboard.visitor import Visitor
from services.service import Service

PAGES: tuple[APIRouter, ...] = (
    overview.router,
    jobs.router,
    models.router,
    scenes.router,
    compare.router,
    webhooks.router,
    reference.router,
    sign_out.router,
)
"""Those that need a session."""

SESSION_ANSWERS: tuple[APIRouter, ...] = (demo.router,)
"""What scripts ask for with a session; refusals are problem documents."""

OPEN_PAGES: tuple[APIRouter, ...] = (
    sign_in.router,
    assets.router,
    demo.open_router,
    clients.router,
    examples.router,
)
"""Those that do not."""


def install(app: FastAPI, service: Service) -> None:
    """Adds the pages to an application.

    Args:
        app: With the service and the guard in its state.
        service: What the pages show.
    """
    app.state.sessions = Sessions(service.database, service.keys)
    app.state.watch = Watch(service)
    app.state.comparer = compare.Comparer(service)
    guarded = APIRouter(dependencies=[Depends(Visitor(app.state.guard, app.state.sessions))])
    for router in (*PAGES, *SESSION_ANSWERS):
        guarded.include_router(router)
    app.include_router(guarded)
    for router in OPEN_PAGES:
        app.include_router(router)
