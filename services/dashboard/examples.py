"""`/examples/`: what `@diaphane/three` does (`deploy/client/web/examples`), as it was built; open, as the demo is."""

from __future__ import annotations

from typing import Annotated, Final

from fastapi import APIRouter, Request, Response
from fastapi import Path as InPath

from services.dashboard.built import CHECKED, FOREVER, Built
from services.dashboard.page import HEADERS

BUILT: Final = Built("examples")

router = APIRouter(prefix="/examples", include_in_schema=False)


@router.get("", response_class=Response)
@router.get("/", response_class=Response)
async def show_examples(request: Request) -> Response:
    """What there is."""
    return BUILT.answer(request, "index.html", {**HEADERS, **CHECKED})


@router.get("/{name}", response_class=Response)
async def show_example(name: Annotated[str, InPath(pattern=r"^[a-z]{1,40}\.(html|md)$")], request: Request) -> Response:
    """A page, or the licences of what they contain of others."""
    return BUILT.answer(request, name, {**HEADERS, **CHECKED})


@router.get("/assets/{name}", response_class=Response)
async def read_example_asset(
    name: Annotated[str, InPath(pattern=r"^[A-Za-z0-9_.-]{1,80}$")], request: Request
) -> Response:
    """A script, style or scene; its name changes with its content."""
    return BUILT.answer(request, f"assets/{name}", FOREVER)
