"""`/demo`: the browser client (`deploy/client/web`), as it was built, and the registry for whoever is signed in.

The page itself is open: it shows nothing of the service. What it asks of the registry needs a session, whose cookie no
script can read; so the page never has a key. The same functions answer as under `/v1`, and only what reads.
"""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import APIRouter, Depends, Request, Response
from fastapi import Path as InPath
from fastapi.responses import JSONResponse

from services.api import blobs, models
from services.api.parameters import require_known
from services.dashboard.built import CHECKED, FOREVER, Built
from services.dashboard.page import HEADERS
from services.dashboard.visitor import COOKIE

BUILT: Final = Built("demo")

open_router = APIRouter(prefix="/demo", include_in_schema=False)
router = APIRouter(prefix="/demo/v1", include_in_schema=False, dependencies=[Depends(require_known)])
"""For scripts, by session: who has none is refused by a problem document, not sent to sign in."""


@open_router.get("", response_class=Response)
async def show_demo(request: Request) -> Response:
    """The page."""
    return BUILT.answer(request, "index.html", {**HEADERS, **CHECKED})


@open_router.get("/assets/{name}", response_class=Response)
async def read_demo_asset(
    name: Annotated[str, InPath(pattern=r"^[A-Za-z0-9_.-]{1,80}$")], request: Request
) -> Response:
    """A script, style or sample; its name changes with its content."""
    return BUILT.answer(request, f"assets/{name}", FOREVER)


@open_router.get("/licences.md", response_class=Response)
async def read_demo_licences(request: Request) -> Response:
    """Of what the script contains of others."""
    return BUILT.answer(request, "licences.md", CHECKED)


@open_router.get("/session", response_class=JSONResponse)
async def show_session(request: Request) -> JSONResponse:
    """Whether the browser sends a session; the page asks before it asks for models, where a refusal would be an error.

    The session may have ended: then the registry refuses. So this needs no look at the database.
    """
    return JSONResponse({"signed_in": bool(request.cookies.get(COOKIE))}, headers={"Cache-Control": "no-store"})


router.add_api_route("/models", models.list_models)
router.add_api_route("/models/{name}/versions/{version}", models.read_version, response_model=None)
router.add_api_route("/models/{name}/pointers/{version}", models.read_pointer)
router.add_api_route("/blobs/sha256/{sha256}", blobs.read_blob, response_class=Response)
