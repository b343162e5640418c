"""Queries in addresses: what a route does not know is refused, since whoever sent it meant something by it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from fastapi import Request
from fastapi.dependencies.models import Dependant
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute


async def require_known(request: Request) -> None:
    """Refuses a parameter that the route does not have, and one that is given twice: only one of them would count.

    Raises:
        RequestValidationError: There is one.
    """
    given = Counter(name for name, _ in request.query_params.multi_items())
    if not given:
        return
    route: APIRoute = request.scope["route"]
    known = set(_names(route.dependant))
    errors = [{"type": "extra_forbidden", "loc": ("query", name)} for name in given if name not in known]
    errors += [{"type": "given_twice", "loc": ("query", name)} for name in sorted(known) if given[name] > 1]
    if errors:
        raise RequestValidationError(errors)


def _names(dependant: Dependant) -> Iterator[str]:
    yield from (field.alias for field in dependant.query_params)
    for inner in dependant.dependencies:
        yield from _names(inner)
