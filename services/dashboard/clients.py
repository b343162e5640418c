"""`/clients/`: the packages for the web (`deploy/client/web`), as `npm pack` makes them; open, as the demo is."""

from __future__ import annotations

import json
from typing import Annotated, Final

from fastapi import APIRouter, Request, Response
from fastapi import Path as InPath

from services.dashboard.built import CHECKED, Built
from services.dashboard.page import PageRoute, render

BUILT: Final = Built("clients")

router = APIRouter(prefix="/clients", route_class=PageRoute, include_in_schema=False)


@router.get("", response_class=Response)
@router.get("/", response_class=Response)
async def show_clients(request: Request) -> Response:
    """What there is, and how it is installed."""
    packages = json.loads(BUILT.files["index.json"][0])["packages"]
    return render(request, "clients", packages=packages, base=str(request.base_url))


@router.get("/{name}", response_class=Response)
async def read_client(name: Annotated[str, InPath(pattern=r"^[a-z0-9.-]{1,80}$")], request: Request) -> Response:
    """A package, or the list of them (`index.json`)."""
    return BUILT.answer(request, name, CHECKED)
