"""Pages of lists: a cursor is the place of the last item, so that what is inserted meanwhile moves nothing."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Sequence
from typing import Annotated, Any, TypeVar
from urllib.parse import urlencode

from fastapi import Depends, Query, Request, Response
from pydantic import Field, TypeAdapter, ValidationError

from schemas.canonical import canonical_json
from services.problems import Refusal

T = TypeVar("T")
P = TypeVar("P")

Moment = tuple[Annotated[float, Field(ge=0.0, le=1e11)], Annotated[str, Field(max_length=64, pattern=r"^[a-z0-9_]*$")]]
"""Place in a list by time: seconds since 1970, and an id among those of the same time."""

MOMENT: TypeAdapter[tuple[float, str]] = TypeAdapter(Moment)
NUMBER: TypeAdapter[int] = TypeAdapter(Annotated[int, Field(ge=0, le=2**53)])
TASK_PLACE: TypeAdapter[tuple[str, int]] = TypeAdapter(
    tuple[Annotated[str, Field(pattern=r"^[a-z]{1,32}$")], Annotated[int, Field(ge=0, le=2**31 - 1)]]
)
"""Place of a task in its job: stage and position."""

NAME: TypeAdapter[str] = TypeAdapter(Annotated[str, Field(max_length=128, pattern=r"^[A-Za-z0-9._-]*$")])

LINK_HEADER: dict[str, Any] = {
    "Link": {
        "description": 'Address of the next page, rel="next"; missing on the last page.',
        "schema": {"type": "string"},
    }
}


class Paging:
    """Which page of a list is asked for.

    Args:
        request: The request.
        response: Gets the Link header.
        limit: Items of the page at most.
        cursor: Of the page before.

    Attributes:
        fetch: How many items to ask the database for: one more tells whether there is another page.
        next: Address of the next page, once `page` was called; None: this is the last.
    """

    def __init__(self, request: Request, response: Response, limit: int, cursor: str | None) -> None:
        self._request, self._response, self._cursor = request, response, cursor
        self.limit, self.fetch = limit, limit + 1
        self.next: str | None = None

    def after(self, kind: TypeAdapter[P]) -> P | None:
        """The place that the page begins after; None for the first page.

        Raises:
            Refusal: The cursor is none of this list.
        """
        if self._cursor is None:
            return None
        try:
            text = base64.b64decode(self._cursor.encode("ascii"), altchars=b"-_", validate=True)
            return kind.validate_json(text, strict=True)
        except (ValidationError, ValueError, binascii.Error):
            raise Refusal("invalid", "The cursor is none of this list.", "Take it from a Link header.") from None

    def page(self, found: Sequence[T], place: Callable[[T], Any]) -> list[T]:
        """The items of the page; sets the Link header if there is another.

        Args:
            found: Up to `fetch` items.
            place: Place of an item, as JSON.
        """
        items = list(found[: self.limit])
        if len(found) > self.limit:
            cursor = base64.urlsafe_b64encode(canonical_json(place(items[-1])).encode()).decode()
            query = [(name, value) for name, value in self._request.query_params.multi_items() if name != "cursor"]
            path = self._request.scope["path"]
            self.next = f"{path}?{urlencode([*query, ('cursor', cursor)])}"
            self._response.headers["Link"] = f'<{self.next}>; rel="next"'
        return items

    def slice(self, found: Sequence[T], name: Callable[[T], str]) -> list[T]:
        """A page of a list that is short enough to be had as a whole, in a fixed order."""
        last = self.after(NAME)
        start = next((index + 1 for index, item in enumerate(found) if name(item) == last), 0)
        return self.page(found[start : start + self.fetch], name)


async def _paging(
    request: Request,
    response: Response,
    limit: Annotated[int, Query(ge=1, le=200, description="Items of a page at most.")] = 50,
    cursor: Annotated[
        str | None, Query(max_length=512, description="Of the Link header of the page before; opaque.")
    ] = None,
) -> Paging:
    return Paging(request, response, limit, cursor)


Page = Annotated[Paging, Depends(_paging)]
"""The page that a request asks for."""
