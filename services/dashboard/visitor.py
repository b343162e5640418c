"""Who looks at a page: the session in the cookie, and whether a form came from a page of ours."""

from __future__ import annotations

import hmac
from typing import Generic, TypeVar
from urllib.parse import parse_qsl, urlsplit

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ValidationError

from schemas.service import KeyRecord
from services.api.body import read_body, require_type
from services.api.security import Guard, require_scope
from services.dashboard.sessions import LIFETIME_SECONDS, Sessions, digest_of, form_token
from services.problems import Refusal

COOKIE = "diaphane_session"
CSRF = "csrf"
"""Name of the form field."""

_FORM = "application/x-www-form-urlencoded"
_FORM_BYTES = 1 << 14

M = TypeVar("M", bound=BaseModel)


class Visitor:
    """The default dependency of every page: a session, within the limits of its key.

    Args:
        guard: Counts the requests of keys, from pages and from clients alike.
        sessions: The sessions.
    """

    def __init__(self, guard: Guard, sessions: Sessions) -> None:
        self._guard, self._sessions = guard, sessions

    def __call__(self, request: Request) -> KeyRecord:
        """The key of a request's session, also in `request.state.key`.

        Raises:
            Refusal: There is no session, it has ended, or its key asks too often.
        """
        token = request.cookies.get(COOKIE, "")
        key = self._guard.admit(request, token, self._sessions.find, digest_of(token)) if token else None
        if key is None:
            raise Refusal("unauthenticated", "The session has ended." if token else "Nobody is signed in.")
        require_scope(key, "read")
        request.state.csrf = form_token(token)
        return key


class FormBody(Generic[M]):
    """A dependency that reads a form as a model, once it is sure that a page of ours sent it.

    Args:
        model: The model; all its fields are texts.
        signed_in: Whether the form belongs to a session, and has to carry that one's token.
    """

    def __init__(self, model: type[M], *, signed_in: bool = True) -> None:
        self.model, self._signed_in = model, signed_in

    async def __call__(self, request: Request) -> M:
        """The form.

        Raises:
            Refusal: Another site sent it, or it is too large or no form.
            RequestValidationError: It is not of the model's form.
        """
        require_own_origin(request)
        require_type(request, _FORM)
        fields = _parse(await read_body(request, _FORM_BYTES))
        sent = fields.pop(CSRF, "")
        if self._signed_in and not hmac.compare_digest(sent.encode(), request.state.csrf.encode()):
            raise Refusal("forbidden", "The form is not of this session.", "Load the page again, then repeat it.")
        try:
            return self.model.model_validate(fields)
        except ValidationError as error:
            raise RequestValidationError([{**one, "loc": ("form", *one["loc"])} for one in error.errors()]) from None


class NoFields(BaseModel):
    """A form that is a button."""


def require_own_origin(request: Request) -> None:
    """Refuses what another site makes a browser send.

    Raises:
        Refusal: The header `Origin` names another host; or it is missing, and `Sec-Fetch-Site` does not say that the
            request is from a page of the same origin.
    """
    origin = request.headers.get("origin", "null")
    if origin == "null":
        own = request.headers.get("sec-fetch-site") == "same-origin"
    else:
        own = urlsplit(origin).netloc.lower() == request.headers.get("host", "").lower()
    if not own:
        raise Refusal("forbidden", "The form was sent by another site.", "Open the dashboard, and repeat it there.")


def set_cookie(request: Request, response: Response, token: str) -> None:
    """Hands a session to the browser."""
    response.set_cookie(
        COOKIE,
        token,
        max_age=int(LIFETIME_SECONDS),
        path="/",
        # Behind a proxy that ends TLS, the origin of the form is what tells.
        secure="https" in (request.url.scheme, urlsplit(request.headers.get("origin", "")).scheme),
        httponly=True,
        samesite="lax",  # a link that somebody shared leads to its page; forms have a token and their origin
    )


def _parse(raw: bytes) -> dict[str, str]:
    try:
        pairs = parse_qsl(raw.decode("ascii"), keep_blank_values=True, errors="strict", max_num_fields=32)
    except ValueError:
        raise Refusal("malformed", "The form cannot be read.") from None
    fields = dict(pairs)
    if len(fields) != len(pairs) or any("\0" in text for text in fields.values()):
        raise Refusal("malformed", "The form names a field twice, or has a NUL character in it.")
    return fields
