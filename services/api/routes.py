"""All routes of REST: those that need a key, and the few that do not. Pages are in `services.dashboard`."""

from __future__ import annotations

from collections.abc import Iterator

from fastapi import APIRouter
from fastapi.routing import APIRoute
from pydantic import BaseModel

from services.api import (
    blobs,
    catalogue,
    datasets,
    document,
    health,
    jobs,
    keys,
    measurements,
    metrics,
    models,
    scenes,
    uploads,
    webhooks,
    workers,
)
from services.api.body import JsonBody
from services.api.security import Needs

GUARDED: tuple[APIRouter, ...] = (
    uploads.router,
    blobs.router,
    scenes.router,
    jobs.router,
    datasets.router,
    models.router,
    measurements.router,
    keys.router,
    webhooks.router,
    workers.router,
    metrics.router,
)
OPEN: tuple[APIRouter, ...] = (health.router, catalogue.router, document.router)


def routes(routers: tuple[APIRouter, ...]) -> Iterator[APIRoute]:
    """The routes of some routers."""
    for router in routers:
        yield from (route for route in router.routes if isinstance(route, APIRoute))


def scope_of(route: APIRoute) -> str:
    """The scope that a guarded route needs.

    Raises:
        TypeError: It changes something, and does not say which scope that needs.
    """
    stated = [found.call.scope for found in route.dependant.dependencies if isinstance(found.call, Needs)]
    if stated:
        return stated[-1]
    if set(route.methods or ()) <= {"GET", "HEAD"}:
        return "read"
    raise TypeError(f"the route {route.path} does not say which scope it needs")


def body_of(route: APIRoute) -> type[BaseModel] | None:
    """The model of a route's JSON body, if it takes one."""
    bodies = [found.call for found in route.dependant.dependencies if isinstance(found.call, JsonBody)]
    return bodies[0].model if bodies else None


def methods_of(path: str, routers: tuple[APIRouter, ...]) -> list[str]:
    """All methods of a path: a router itself knows those of the first route only."""
    found: set[str] = set()
    for route in routes(routers):
        if route.path_regex.match(path):
            found |= set(route.methods or ())
    return sorted(found)
