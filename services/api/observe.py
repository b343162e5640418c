"""The outermost layer: request ids, host names, security headers, access log, metrics, and what nobody caught."""

from __future__ import annotations

import re
import time
import uuid
from collections.abc import Callable, Sequence
from http import HTTPStatus
from traceback import format_exception
from typing import Any

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from services.api.errors import Answer, refusal_for
from services.api.metrics import Metrics
from services.api.rate import Allowance
from services.problems import Refusal

LOOPBACK = ("localhost", "127.0.0.1", "[::1]")
"""Names of a server that listens on the loopback interface."""

_SHORT_BYTES = 1 << 16
"""Of a body that is left unread and costs nothing."""

_REQUEST_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'none'; frame-ancestors 'none'",
    "Cache-Control": "no-store",
}

log = structlog.get_logger("diaphane.access")


class Observe:
    """Wraps an application.

    Args:
        app: The application.
        metrics: Where requests are counted.
        answer: Makes the answer to a request that is refused here.
        hosts: Names that the server answers for; `*`: any.
        window: Seconds in which a key's bucket fills, as the RateLimit headers tell it.
        burst: Requests that a bucket holds.
        note_full: Told when a request met a disk that is full.
    """

    def __init__(
        self,
        app: ASGIApp,
        metrics: Metrics,
        answer: Answer,
        hosts: Sequence[str],
        window: float,
        burst: int,
        note_full: Callable[[], None],
    ) -> None:
        self._app, self._metrics, self.answer, self._note_full = app, metrics, answer, note_full
        self._hosts = None if "*" in hosts else frozenset(host.lower() for host in hosts)
        self._policy = f'"key";q={burst};w={max(1, round(window))}'

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answers a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        await _Exchange(self, scope, receive, send).run(self._app)

    def answers_for(self, host: str) -> bool:
        """Whether a `Host` header names this server, with or without a port."""
        name = host.lower() if host.endswith("]") else host.lower().rpartition(":")[0] or host.lower()
        return self._hosts is None or name in self._hosts

    def count(self, method: str, scope: Scope, status: int, seconds: float, size: int) -> None:
        """See `Metrics.count`."""
        if status == HTTPStatus.INSUFFICIENT_STORAGE:
            self._note_full()
        route = getattr(scope.get("route"), "path", "other")
        self._metrics.count(method if method in _METHODS else "other", route, status, seconds, size)

    def limits(self, allowance: Allowance | None) -> dict[str, str]:
        """The RateLimit headers."""
        if allowance is None:
            return {}
        return {"RateLimit-Policy": self._policy, "RateLimit": f'"key";r={allowance.left};t={round(allowance.full)}'}


class _Exchange:
    """One request and its answer."""

    def __init__(self, observer: Observe, scope: Scope, receive: Receive, send: Send) -> None:
        self._observer, self._scope = observer, scope
        self._receive, self._send = receive, send
        self._begun = time.perf_counter()
        self._first: float | None = None
        self._status, self._size = 0, 0
        self._state: dict[str, Any] = scope.setdefault("state", {})
        self._request = Headers(scope=scope)
        self._unread = self._request.get("content-length", "0") != "0" or "transfer-encoding" in self._request
        proposed = self._request.get("x-request-id", "")
        self._state["request_id"] = proposed if _REQUEST_ID.fullmatch(proposed) else uuid.uuid4().hex

    async def run(self, app: ASGIApp) -> None:
        with structlog.contextvars.bound_contextvars(request_id=self._state["request_id"]):
            try:
                if self._observer.answers_for(self._request.get("host", "")):
                    await app(self._scope, self.receive, self.send)
                else:
                    await self._refuse(Refusal("misdirected"))
            except Exception as error:
                refusal = refusal_for(error)
                if refusal is None:
                    # Formatted here, so that no renderer adds the variables of the frames: secrets are among them.
                    log.error("unexpected error", exception="".join(format_exception(error)))
                if self._first is not None:
                    raise  # the answer has begun: the server closes the connection
                await self._refuse(refusal or Refusal("internal"))
            finally:
                self._finish()

    async def _refuse(self, refusal: Refusal) -> None:
        await self._observer.answer(refusal, self._scope)(self._scope, self._receive, self.send)

    async def receive(self) -> Message:
        message = await self._receive()
        self._unread = self._unread and message["type"] == "http.request" and message.get("more_body", False)
        return message

    async def send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self._first, self._status = time.perf_counter(), message["status"]
            headers = MutableHeaders(scope=message)
            if self._unread and self._is_long():
                headers["Connection"] = "close"  # else whoever is refused could go on sending for ever
            headers["X-Request-ID"] = self._state["request_id"]
            for name, value in {**_HEADERS, **self._observer.limits(self._state.get("allowance"))}.items():
                headers.setdefault(name, value)
        elif message["type"] == "http.response.body":
            self._size += len(message.get("body", b""))
        await self._send(message)

    def _is_long(self) -> bool:
        length = self._request.get("content-length", "")
        return not length.isdecimal() or int(length[:20]) > _SHORT_BYTES

    def _finish(self) -> None:
        now = time.perf_counter()
        status = self._status or 499  # nobody was there any more to be answered
        first = (self._first or now) - self._begun
        method = self._scope["method"]
        self._observer.count(method, self._scope, status, first, self._size)
        key = self._state.get("key")
        log.info(
            "request",
            method=method,
            path=self._scope["path"][:200],
            status=status,
            bytes=self._size,
            ms=round(1000.0 * (now - self._begun), 1),
            client=(self._scope.get("client") or ("",))[0],
            key=None if key is None else key.id,
        )
