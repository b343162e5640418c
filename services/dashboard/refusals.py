"""How a refused request is answered: a browser gets a page, whoever talks to the API a problem document."""

from __future__ import annotations

import math
from typing import Any

from fastapi import Request, Response

from services.api.errors import answer as document_answer
from services.dashboard.page import problem_page
from services.problems import Refusal

_API = "/v1"


def answer(refusal: Refusal, scope: Any) -> Response:
    """The response to a request that is refused outside the pages.

    Args:
        refusal: Why.
        scope: Of the request (ASGI).
    """
    request = Request(scope)
    return problem_page(request, refusal) if _wants_page(request) else document_answer(refusal, scope)


def _wants_page(request: Request) -> bool:
    """Whether the address is not of the API, and HTML is named in `Accept` and liked no less than JSON."""
    path = request.scope["path"]
    if path == _API or path.startswith(f"{_API}/"):
        return False
    liked = _liked(request.headers.get("accept", ""))
    return liked.get("text/html", 0.0) > 0.0 and liked["text/html"] >= max(
        liked.get("application/json", 0.0), liked.get("application/problem+json", 0.0)
    )


def _liked(accept: str) -> dict[str, float]:
    """Media type -> how much it is liked (RFC 9110, 12.4.2), of those that are named."""
    found: dict[str, float] = {}
    for part in accept.lower().split(","):
        kind, *parameters = (piece.strip() for piece in part.split(";"))
        weight = next((p[2:] for p in parameters if p.startswith("q=")), "1")
        try:
            liked = float(weight)
        except ValueError:
            liked = 0.0
        found[kind] = liked if math.isfinite(liked) else 0.0
    return found
