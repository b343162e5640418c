"""`/sign-out`: ends the session."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Request, Response

from services.api.security import Needs
from services.dashboard.page import PageRoute, redirect
from services.dashboard.visitor import COOKIE, FormBody, NoFields

router = APIRouter(route_class=PageRoute, include_in_schema=False)


@router.post("/sign-out", response_class=Response, dependencies=[Depends(Needs("read"))])
def sign_out(request: Request, _: Annotated[NoFields, Depends(FormBody(NoFields))]) -> Response:
    """Ends the session, here and in the database."""
    request.app.state.sessions.close(request.cookies[COOKIE])
    response = redirect("/sign-in")
    response.delete_cookie(COOKIE, path="/", httponly=True, samesite="lax")
    return response
