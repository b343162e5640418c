"""Pages: what all of them share, the policy that they obey, and how a problem looks."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Coroutine, Mapping
from datetime import datetime
from functools import cache
from pathlib import Path
from traceback import format_exception
from typing import Any, Final
from urllib.parse import quote

import structlog
from fastapi import Request, Response
from fastapi.routing import APIRoute
from jinja2 import Environment
from markupsafe import Markup

from evaluation.report.page import environment
from schemas.service import JobRecord, KeyRecord, Scope
from services.api.errors import refusal_for
from services.dashboard.assets import address, charts_script
from services.keys import allows
from services.problems import Refusal

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'; form-action 'self'; "
    "base-uri 'none'; frame-ancestors 'none'"
)
"""Content-Security-Policy: nothing inline, nothing from elsewhere."""

# Not `no-referrer`: browsers would then hide where a form comes from.
HEADERS = {"Content-Security-Policy": POLICY, "Referrer-Policy": "same-origin"}

PAGES = (
    ("/", "Overview"),
    ("/jobs", "Jobs"),
    ("/models", "Models"),
    ("/scenes", "Scenes"),
    ("/compare", "Compare"),
    ("/demo", "Demo"),
    ("/docs", "API"),
)
"""What the navigation leads to."""

_LOCAL = re.compile(r"/(?![/\\])[\x21-\x5b\x5d-\x7e]{0,1999}")  # no longer than what `/sign-in` takes
_TEMPLATES: Final = Path(__file__).resolve().parent.parent / "templates"
_UNITS = ((86400.0, "d"), (3600.0, "h"), (60.0, "min"), (1.0, "s"))

_AGAIN = frozenset({429, 500, 503})
"""Statuses after which the same request may well succeed."""

# The catalogue speaks to those who write clients.
_REMEDIES: Final[Mapping[str, str]] = {
    "not-found": "Check the address, or look for what you want in the lists below.",
    "method-not-allowed": "The address belongs to a button or a form: go back to its page, and use that.",
    "invalid": "Correct what is named in the address or the form, then try again.",
    "forbidden": "Sign out, and sign in with a key that has the scope; `diaphane keys create` makes one.",
}

log = structlog.get_logger("diaphane.dashboard")


def render(request: Request, template: str, status: int = 200, **values: Any) -> Response:
    """A page.

    Args:
        request: The request.
        template: Name in `templates/dashboard`, without suffixes.
        status: HTTP status.
        values: What the template shows.
    """
    who: KeyRecord | None = getattr(request.state, "key", None)

    def may(scope: Scope) -> bool:
        return who is not None and allows(who, scope)

    text = (
        _environment()
        .get_template(f"dashboard/{template}.html.j2")
        .render(
            who=who,
            may=may,
            csrf=getattr(request.state, "csrf", ""),
            path=request.scope["path"],
            first="cursor" not in request.query_params,  # of the pages of a list
            **values,
        )
    )
    return Response(text, status, HEADERS, media_type="text/html")


def redirect(to: str) -> Response:
    """Sends the browser to another page, with GET."""
    return Response(status_code=303, headers={**HEADERS, "Location": to})


def is_local(address_of: str) -> bool:
    """Whether an address is one of this server's, without a host in it: where a browser may be sent to."""
    return _LOCAL.fullmatch(address_of) is not None


def problem_page(request: Request, refusal: Refusal) -> Response:
    """A page that says what is wrong, and what to do."""
    status = refusal.type.status
    problem = refusal.document(request_id=request.state.request_id)
    if not refusal.remedy:
        problem = problem.model_copy(update={"remedy": _remedy(refusal)})
    asked = _asked(request)
    again = asked if status in _AGAIN and request.method == "GET" and is_local(asked) else ""
    page = render(request, "problem", status, problem=problem, again=again)
    page.headers.update(refusal.headers)
    return page


def _remedy(refusal: Refusal) -> str:
    wait = refusal.headers.get("Retry-After", "")
    if refusal.type.slug == "too-many-requests" and wait.isdecimal():
        return f"Wait {wait} second{'' if wait == '1' else 's'}, then try again."
    return _REMEDIES.get(refusal.type.slug, refusal.type.remedy)


class PageRoute(APIRoute):
    """A route whose errors are pages, and which sends whoever is not signed in to where one does."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """The handler, with errors as pages around it."""
        inner = super().get_route_handler()

        async def handle(request: Request) -> Response:
            try:
                return await inner(request)
            except Exception as error:
                return _problem_page(request, error)

        return handle


def _problem_page(request: Request, error: Exception) -> Response:
    refusal = refusal_for(error)
    if refusal is None:
        log.error("unexpected error", exception="".join(format_exception(error)))
        refusal = Refusal("internal")
    if refusal.type.slug == "unauthenticated":
        return _to_sign_in(request)
    return problem_page(request, refusal)


def _to_sign_in(request: Request) -> Response:
    is_part = request.headers.get("hx-request") == "true"
    asked = _shown(request) if is_part else _asked(request)
    to = "/sign-in"
    if request.method == "GET" and asked != "/" and is_local(asked):
        to += f"?next={quote(asked, safe='')}"
    # With a part of a page the whole page has to go.
    return Response(status_code=401, headers={**HEADERS, "HX-Redirect": to}) if is_part else redirect(to)


def _asked(request: Request) -> str:
    """Path and query of a request; not from its `url`, which the header `Host` is a part of."""
    query = request.scope["query_string"].decode("latin-1")
    return quote(request.scope["path"], safe="/:@!$&'()*+,;=~") + (f"?{query}" if query else "")


def _shown(request: Request) -> str:
    """Path and query of the page that a script asks for a part of."""
    page = request.headers.get("hx-current-url", "").partition("://")[2].partition("#")[0]
    return f"/{page.partition('/')[2]}"


@cache
def _environment() -> Environment:
    made = environment(_TEMPLATES)
    made.globals.update(asset=address, charts_script=charts_script, pages=PAGES)
    made.filters.update(when=when, duration=duration, took=_took, percent=_percent, size=_size)
    return made


def when(moment: str | None) -> str:
    """A time (ISO 8601, UTC): how long ago, and exactly where one points at it."""
    if moment is None:
        return "–"
    then = datetime.fromisoformat(moment)
    ago = duration(time.time() - then.timestamp())
    exact = f"{then:%Y-%m-%d %H:%M:%S} UTC"
    return Markup('<time datetime="{}" title="{}">{} ago</time>').format(moment, exact, ago)


def duration(seconds: float | None) -> str:
    """Two units of a time at most: `3 h 20 min`."""
    if seconds is None:
        return "–"
    left = max(0.0, seconds)
    parts: list[str] = []
    for size, unit in _UNITS:
        if left >= size or (unit == "s" and not parts):
            parts.append(f"{int(left // size)} {unit}")
            left %= size
    return " ".join(parts[:2])


def _took(job: JobRecord) -> str:
    if job.started is None:
        return "–"
    end = datetime.fromisoformat(job.finished).timestamp() if job.finished else time.time()
    return duration(end - datetime.fromisoformat(job.started).timestamp())


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:.0f} %"


def _size(count: int) -> str:
    value, unit = float(count), "B"
    for unit in ("B", "KiB", "MiB", "GiB"):
        if value < 1024.0 or unit == "GiB":
            break
        value /= 1024.0
    return f"{value:.0f} {unit}" if unit == "B" else f"{value:.1f} {unit}"
