"""Every error as an answer: `application/problem+json`, unless the application says otherwise."""

from __future__ import annotations

import errno
import json
from collections.abc import Awaitable, Callable, Sequence
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from sqlalchemy.exc import DBAPIError, InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from schemas.problem import Problem
from services.api.routes import methods_of
from services.api.wording import faults, sentence
from services.database.connection import is_full
from services.problems import MEDIA_TYPE, Refusal, refusal_of

_ERRORS = 20
_LENGTH = 200
_RETRY_SECONDS = "2"
_OF_STATUS = {
    400: "malformed",
    401: "unauthenticated",
    403: "forbidden",
    404: "not-found",
    409: "conflict",
    413: "too-large",
    415: "unsupported-media-type",
    416: "range-not-satisfiable",
    422: "invalid",
    503: "unavailable",
    507: "storage-full",
}

Answer = Callable[[Refusal, Any], Response]
"""Makes the response to a request that is refused, given the request's scope (ASGI)."""

log = structlog.get_logger("diaphane.api")


def answer(refusal: Refusal, scope: Any) -> Response:
    """The response to a request that is refused."""
    request_id = scope.get("state", {}).get("request_id", "")
    document = refusal.document(instance=str(scope.get("path", ""))[:_LENGTH], request_id=request_id)
    # ASCII only: the path may hold what cannot be encoded.
    content = json.dumps(document.model_dump(mode="json"), ensure_ascii=True).encode()
    headers = dict(refusal.headers)
    if refusal.type.status == 503:
        headers.setdefault("Retry-After", _RETRY_SECONDS)
    return Response(content, refusal.type.status, headers, media_type=MEDIA_TYPE)


def refusal_for(error: Exception) -> Refusal | None:
    """What an error means for the client; None: it is a fault of the service."""
    if isinstance(error, Refusal):
        return error
    if _is_full(error):
        log.error("no room is left", error=type(error).__name__)
        return Refusal("storage-full")
    if isinstance(error, Problem):
        return refusal_of(error)
    if isinstance(error, ClientDisconnect):
        return Refusal("malformed", "The connection ended before the body did.")
    if isinstance(error, RequestValidationError):
        return _invalid(error.errors())
    if isinstance(error, (OperationalError, InterfaceError, PoolTimeoutError)) or (
        isinstance(error, DBAPIError) and error.connection_invalidated
    ):
        log.warning("database away", error=type(error).__name__)
        return Refusal("unavailable", "The database cannot be reached.")
    if isinstance(error, HTTPException) and error.status_code in _OF_STATUS:
        return Refusal(_OF_STATUS[error.status_code], headers=error.headers)
    return None


def install(app: FastAPI, answer: Answer = answer) -> None:
    """Makes every error of the application an answer.

    Args:
        app: The application.
        answer: Makes them; the default makes each a problem document.
    """

    async def handle(request: Request, error: Exception) -> Response:
        if isinstance(error, HTTPException) and error.status_code == 405:
            allowed = ", ".join(methods_of(request.scope["path"], request.app.state.routers))
            return answer(Refusal("method-not-allowed", headers={"Allow": allowed}), request.scope)
        refusal = refusal_for(error)
        if refusal is None:
            raise error  # the outermost layer logs it and answers 500
        return answer(refusal, request.scope)

    handler: Callable[[Request, Exception], Awaitable[Response]] = handle
    for kind in (
        HTTPException,
        RequestValidationError,
        Refusal,
        Problem,
        DBAPIError,
        PoolTimeoutError,
        ClientDisconnect,
        OSError,
    ):
        app.add_exception_handler(kind, handler)


def _is_full(error: Exception) -> bool:
    if isinstance(error, OSError):
        return error.errno in (errno.ENOSPC, errno.EDQUOT)
    return isinstance(error, DBAPIError) and is_full(error)


def _invalid(errors: Sequence[Any]) -> Refusal:
    """Only places and rules, never what was sent."""
    if errors and all(error["loc"][:1] == ("path",) for error in errors):
        return Refusal("not-found", "The address names nothing: an id in it is not of the right form.")
    places = faults(errors[:_ERRORS])
    return Refusal("invalid", sentence(places[0]) if places else "", errors=places)
