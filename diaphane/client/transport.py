"""Requests to a server that may be busy, restarting or gone for a moment, and what its refusals mean to a user.

Rules:
- a request that can be repeated is repeated while the server cannot be reached, is overloaded or restarts; one that
  cannot, only while it has certainly not arrived;
- `Retry-After` is obeyed; otherwise waits double, with some randomness so that many clients do not come back at once;
- a link is only followed on the server itself, so that the key goes nowhere else;
- the key is in one header and nowhere else (`connection`): not in messages, not in logs, not in `repr`.
"""

from __future__ import annotations

import logging
import random
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import httpx

from diaphane.cli.lines import plain
from diaphane.client.connection import BadKey, BadUrl, checked_url, connect
from schemas.problem import ExitCode, Problem

LOG = logging.getLogger(__name__)

PATIENCE_SECONDS = 60.0
FIRST_PATIENCE_SECONDS = 10.0
"""How long a server is waited for that has not answered once: a mistyped address should not take a minute."""

_FIRST_WAIT_SECONDS = 0.2
_LONGEST_WAIT_SECONDS = 5.0
_PAGE = 200
"""Items of a page at most, as the server limits it."""
_TRY_AGAIN = (429, 502, 503, 504)
_TIMEOUT = httpx.Timeout(60.0, connect=5.0)

_CODES = {
    401: ExitCode.AUTH,
    403: ExitCode.AUTH,
    404: ExitCode.NOT_FOUND,
    408: ExitCode.TRY_AGAIN,
    409: ExitCode.CONFLICT,
    410: ExitCode.NOT_FOUND,
    412: ExitCode.CONFLICT,
    413: ExitCode.LIMIT,
    429: ExitCode.TRY_AGAIN,
    431: ExitCode.LIMIT,
    500: ExitCode.CHECK_FAILED,
    502: ExitCode.TRY_AGAIN,
    503: ExitCode.TRY_AGAIN,
    504: ExitCode.TRY_AGAIN,
    507: ExitCode.TRY_AGAIN,
}

_REMEDIES = {
    ExitCode.AUTH: "Set DIAPHANE_KEY to a key with that scope; `diaphane keys create` makes one.",
    ExitCode.NOT_FOUND: "Check the name, and that DIAPHANE_URL is the right server.",
    ExitCode.TRY_AGAIN: "Try again later; what is done already is found again.",
    ExitCode.CHECK_FAILED: "Look into the server's log for the request.",
}


class RefusedRequest(Problem):
    """The server answered with a problem.

    Attributes:
        status: HTTP status.
        retry_after: Seconds that the server asks to wait.
    """

    def __init__(self, title: str, remedy: str, code: ExitCode, status: int, retry_after: float | None = None) -> None:
        super().__init__(title, remedy, code)
        self.status = status
        self.retry_after = retry_after


@dataclass(slots=True)
class Backoff:
    """Waits that get longer, until patience is over.

    Args:
        patience: Seconds.
        sleep: How to wait.
    """

    patience: float
    sleep: Callable[[float], None] = time.sleep
    _wait: float = _FIRST_WAIT_SECONDS
    _waited: float = 0.0

    def pause(self, asked: float | None = None) -> bool:
        """Waits for `asked` seconds, or for its own time; False, without waiting, if that is beyond patience."""
        wait = self._wait * random.uniform(0.75, 1.25) if asked is None else asked
        if self._waited + wait > self.patience:
            return False
        self._wait = min(_LONGEST_WAIT_SECONDS, 2.0 * self._wait)
        self._waited += wait
        self.sleep(wait)
        return True


class Transport:
    """One server.

    Args:
        url: Where it is, `http://host:port` or `https://...`, with a path if it lies under one.
        key: API key; None: requests go without.
        patience: Seconds that a request is repeated for, once the server has answered.
        first_patience: The same before it has answered at all.

    Raises:
        Problem: The URL is not one, or carries a password; or the key is not one.
    """

    def __init__(
        self,
        url: str,
        key: str | None,
        *,
        patience: float = PATIENCE_SECONDS,
        first_patience: float = FIRST_PATIENCE_SECONDS,
    ) -> None:
        self._patience, self._first_patience = patience, first_patience
        self._answered = False
        try:
            self.url = checked_url(url)
            self._client = connect(url, key, _TIMEOUT, {"User-Agent": "diaphane", "Accept": "application/json"})
        except BadUrl as error:
            raise Problem(error.what, error.remedy) from None
        except BadKey as error:
            raise Problem(str(error), "A key is one word: dia_...", ExitCode.AUTH) from None

    def close(self) -> None:
        """Closes the connections."""
        self._client.close()

    @property
    def patience(self) -> float:
        """Seconds that the next request is repeated for."""
        return self._patience if self._answered else self._first_patience

    def request(
        self,
        method: str,
        path: str,
        *,
        json: Any = None,
        params: Mapping[str, Any] | None = None,
        headers: Mapping[str, str] | None = None,
        content: bytes | None = None,
        repeatable: bool = True,
    ) -> httpx.Response:
        """Sends a request until the server takes or refuses it.

        Args:
            method: HTTP method.
            path: From `/v1` on.
            json: Body, as JSON.
            params: Query; None values are left out.
            headers: Beside those of every request.
            content: Body, as bytes.
            repeatable: Whether doing it twice is the same as doing it once.

        Raises:
            RefusedRequest: The server refused it.
            Problem: The server cannot be reached.
        """
        backoff = Backoff(self.patience)
        while True:
            try:
                response = self._client.request(
                    method,
                    path,
                    json=json,
                    params=_present(params),
                    headers=dict(headers or {}),
                    content=content,
                )
            except httpx.TransportError as error:
                unsent = isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)
                if not (repeatable or unsent) or not self._pause(backoff, None, error):
                    raise self._unreachable(error) from None
                continue
            self._answered = True
            if response.is_success or response.status_code == httpx.codes.NOT_MODIFIED:
                return response
            again = response.status_code == httpx.codes.TOO_MANY_REQUESTS or repeatable
            if response.status_code in _TRY_AGAIN and again and self._pause(backoff, _retry_after(response), response):
                continue
            raise refusal(response)

    @contextmanager
    def stream(self, path: str, *, headers: Mapping[str, str]) -> Iterator[httpx.Response]:
        """An answer that is read as it comes; not repeated, because only the reader knows where to go on.

        Raises:
            RefusedRequest: The server refused it.
            httpx.TransportError: The connection failed, at first or later.
        """
        with self._client.stream("GET", path, headers=dict(headers)) as response:
            self._answered = True
            if not response.is_success:
                response.read()
                raise refusal(response)
            yield response

    def items(self, path: str, params: Mapping[str, Any] | None = None, limit: int | None = None) -> Iterator[Any]:
        """The items of a list, page by page.

        Args:
            path: Of the list.
            params: Query of the first page.
            limit: How many items; None: all.
        """
        query: Mapping[str, Any] = dict(params or {})
        left = limit
        while True:
            response = self.request("GET", path, params=query if left is None else {**query, "limit": min(left, _PAGE)})
            items = response.json()["items"]
            yield from items if left is None else items[:left]
            left = None if left is None else left - len(items)
            link = response.links.get("next", {}).get("url")
            if not link or not items or (left is not None and left <= 0):
                return
            # Only the query of the link counts: behind a proxy, its host and path may be those of the inside.
            query = dict(httpx.URL(link).params)

    def _pause(self, backoff: Backoff, asked: float | None, why: Exception | httpx.Response) -> bool:
        reason = f"HTTP {why.status_code}" if isinstance(why, httpx.Response) else _reason(why)
        LOG.debug("%s: %s; trying again", self.url, reason)
        return backoff.pause(asked)

    def _unreachable(self, error: httpx.TransportError) -> Problem:
        return Problem(
            f"The server {self.url} cannot be reached ({_reason(error)}).",
            "Start it with `diaphane serve`, or set DIAPHANE_URL to where it is.",
            ExitCode.TRY_AGAIN,
        )


def refusal(response: httpx.Response) -> RefusedRequest:
    """What an answer other than success means to a user."""
    document: dict[str, Any] = {}
    if "json" in response.headers.get("content-type", ""):
        try:
            found = response.json()
        except ValueError:
            found = None
        document = found if isinstance(found, dict) else {}
    code = _code(response.status_code, document)
    title = str(document.get("detail") or document.get("title") or f"The server answered {response.status_code}.")
    errors = [error for error in document.get("errors") or () if isinstance(error, dict)]
    if unsaid := [_place(error) for error in errors if str(error.get("message", "")) not in title]:
        title = f"{title.rstrip('.')}: {'; '.join(unsaid)}."
    if request_id := document.get("request_id"):
        title = (
            f"{title} (request {request_id})" if response.status_code >= httpx.codes.INTERNAL_SERVER_ERROR else title
        )
    remedy = str(document.get("remedy") or _REMEDIES.get(code, "Change the request."))
    return RefusedRequest(plain(title), plain(remedy), code, response.status_code, _retry_after(response))


def _code(status: int, document: Mapping[str, Any]) -> ExitCode:
    if str(document.get("type", "")).endswith("/check-failed"):
        return ExitCode.CHECK_FAILED
    return _CODES.get(status, ExitCode.CHECK_FAILED if status >= httpx.codes.INTERNAL_SERVER_ERROR else ExitCode.USAGE)


def _place(error: Mapping[str, Any]) -> str:
    return f"{error.get('at', '')}: {error.get('message', '')}".removeprefix(": ")


def _retry_after(response: httpx.Response) -> float | None:
    try:
        return max(0.0, float(response.headers["retry-after"]))
    except (KeyError, ValueError):
        return None


def _reason(error: Exception) -> str:
    return plain(str(error))[:200] or type(error).__name__


def _present(params: Mapping[str, Any] | None) -> dict[str, Any]:
    return {name: value for name, value in (params or {}).items() if value is not None}
