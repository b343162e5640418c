"""`/sign-in`: an API key for a session."""

from __future__ import annotations

from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Depends, Query, Request, Response
from pydantic import BaseModel, ConfigDict, Field

from services.api.parts import Services
from services.api.security import Guard
from services.dashboard.page import PageRoute, is_local, redirect, render
from services.dashboard.visitor import FormBody, set_cookie
from services.keys import allows

router = APIRouter(route_class=PageRoute, include_in_schema=False)


class SignIn(BaseModel):
    """What is filled in.

    Attributes:
        key: Secret of an API key.
        next: The page that was asked for.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: str = Field(max_length=200)
    next: str = Field(default="", max_length=2000)


@router.get("/sign-in", response_class=Response)
async def show_sign_in(request: Request, to: Annotated[str, Query(alias="next", max_length=2000)] = "") -> Response:
    """The form."""
    return render(request, "sign_in", to=to if is_local(to) else "", wrong=False)


@router.post("/sign-in", response_class=Response)
async def sign_in(
    request: Request, service: Services, body: Annotated[SignIn, Depends(FormBody(SignIn, signed_in=False))]
) -> Response:
    """Begins a session."""
    guard: Guard = request.app.state.guard
    to = body.next if is_local(body.next) else "/"
    key = await to_thread.run_sync(guard.admit, request, body.key.strip(), service.keys.authenticate)
    if key is None or not allows(key, "read"):
        return render(request, "sign_in", 401, to=to, wrong=True)
    token = await to_thread.run_sync(request.app.state.sessions.open, key)
    response = redirect(to)
    set_cookie(request, response, token)
    return response
