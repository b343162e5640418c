"""HTTP/1.1 as uvicorn speaks it, with bounds on what a connection holds before anybody knows who it is.

Rules:
- the head of a request has at most `LIMITS.head_bytes` and `LIMITS.headers`, counted while it arrives; trailers and
  the frames of chunks are held to the same, since a parser keeps them just as long;
- a server has at most `LIMITS.connections`, or as many as the process may open: a further one is refused at once;
- a connection on which no request is under way, or a head has begun, is closed after `LIMITS.head_seconds`, however
  many bytes trickle in: only a whole head counts;
- what is refused here is a problem document, as everywhere else, and ends the connection;
- a connection that was accepted just before the server is told to stop still gets its answer;
- an answer that nobody takes is given up, so that a connection that was closed does not stay for what it has not sent.

Bodies that a handler waits for are bounded by `services.api.body`.
"""

from __future__ import annotations

import asyncio
import resource
from http import HTTPStatus
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from schemas.limits import LIMITS
from services.api.errors import answer
from services.problems import Refusal

ARRIVAL_SECONDS = 0.5
"""In which a request comes on a connection that was opened just before the server stops."""
_OWN_FILES = 256
"""Files and connections of the process itself, beside those of its clients."""


class BoundedProtocol(HttpToolsProtocol):
    """A connection of uvicorn's, bounded.

    Args:
        arguments: Of uvicorn's protocol.
        options: The same.
    """

    most_connections = LIMITS.connections
    head_seconds = LIMITS.head_seconds
    send_stall_seconds = LIMITS.send_stall_seconds

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._held = 0  # bytes that came since the parser last handed on a body, or was done with a head
        self._head, self._count = 0, 0  # bytes and headers of the request so far
        self._in_head = False
        self._refusal: Refusal | None = None
        self._deadline: asyncio.TimerHandle | None = None
        self._is_last = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn's
        """Begins to wait for a request, if there is room for one more connection."""
        super().connection_made(transport)
        self._expect()
        if len(self.connections) > self.most_connections:
            self._refusal = Refusal("unavailable", "Too many connections are open.")
            self.send_400_response("")

    def connection_lost(self, exc: Exception | None) -> None:
        """Forgets the time limit."""
        self._arrived()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Counts what came, and has it parsed."""
        self._held += len(data)
        super().data_received(data)
        if self.transport.is_closing():
            return
        if self._held > LIMITS.head_bytes:
            self._refusal = _too_long()
            self.send_400_response("")
        elif self._in_head or self.cycle is None or self.cycle.response_complete:
            self._expect()

    def on_message_begin(self) -> None:
        """A head begins."""
        super().on_message_begin()
        self._head, self._count, self._in_head = 0, 0, True

    def on_url(self, url: bytes) -> None:
        """Counts the address."""
        self._take(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Counts a header, or a trailer."""
        self._count += 1
        self._take(len(name) + len(value))
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """The head is there: the request begins."""
        self._in_head, self._held = False, 0
        self._arrived()
        super().on_headers_complete()
        if self._is_last and self.cycle is not None:
            self.cycle.keep_alive = False

    def on_body(self, body: bytes) -> None:
        """A piece of a body is handed on."""
        self._held = 0
        super().on_body(body)

    def on_message_complete(self) -> None:
        """A request is there as a whole."""
        self._held = 0
        super().on_message_complete()

    def send_400_response(self, msg: str) -> None:
        """Refuses what is no request, and closes the connection; uvicorn calls it when its parser gives up.

        Args:
            msg: What uvicorn would say.
        """
        under_way = self.cycle is not None and self.cycle.response_started and not self.cycle.response_complete
        if not under_way:  # else the refusal would stand in the middle of another answer
            self.transport.write(_written(self._refusal or Refusal("malformed", "This is not HTTP/1.1.")))
        self._close()

    def on_response_complete(self) -> None:
        """An answer was handed to the transport; where the connection ends with it, it may still have to be sent."""
        super().on_response_complete()
        if self.transport.is_closing():
            self._watch_rest(self.transport.get_write_buffer_size() + 1)

    def shutdown(self) -> None:
        """Ends the connection after the answer under way, also if its first request is still on the way."""
        if self.cycle is not None:
            super().shutdown()
            return
        self._is_last = True
        self.loop.call_later(ARRIVAL_SECONDS, self._end_unused)

    def timeout_keep_alive_handler(self) -> None:
        """Closes a connection that is not used, and soon also one whose last answer is not taken."""
        if not self.transport.is_closing():
            self._close()

    def _end_unused(self) -> None:
        if self.cycle is None and not self.transport.is_closing():
            self._close()

    def _take(self, size: int) -> None:
        self._head += size
        if self._head > LIMITS.head_bytes or self._count > LIMITS.headers:
            self._refusal = _too_long()
            raise ValueError("the head of the request is too long")  # ends the parsing

    def _expect(self) -> None:
        """Begins to wait for a whole head, unless that is being done."""
        if self._deadline is None:
            self._deadline = self.loop.call_later(self.head_seconds, self._lapse)

    def _arrived(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _lapse(self) -> None:
        self._deadline = None
        if self.transport.is_closing():
            return
        if self._in_head:
            self._refusal = Refusal("too-slow", f"The head did not arrive within {self.head_seconds:g} seconds.")
            self.send_400_response("")
        else:
            self._close()

    def _close(self) -> None:
        """Closes the connection once all is sent, for as long as some of it is taken."""
        self._arrived()
        self.transport.close()
        self._watch_rest(self.transport.get_write_buffer_size() + 1)

    def _watch_rest(self, before: int) -> None:
        left = self.transport.get_write_buffer_size()
        if left and left >= before:
            self.transport.abort()
        elif left:
            self.loop.call_later(self.send_stall_seconds, self._watch_rest, left)


def room_for_connections() -> int:
    """How many connections a server may have, once the process may open as many files as it is allowed to."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = LIMITS.connections + _OWN_FILES
    soft = wanted if hard == resource.RLIM_INFINITY else min(hard, wanted)
    if soft > resource.getrlimit(resource.RLIMIT_NOFILE)[0]:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    return max(1, min(LIMITS.connections, soft - _OWN_FILES))


def _too_long() -> Refusal:
    return Refusal(
        "headers-too-large", f"A request has at most {LIMITS.headers} headers of {LIMITS.head_bytes} bytes in all."
    )


def _written(refusal: Refusal) -> bytes:
    """A refusal as it goes over the wire."""
    response = answer(refusal, {})
    status = response.status_code
    lines = [f"HTTP/1.1 {status} {HTTPStatus(status).phrase}".encode()]
    lines += [name + b": " + value for name, value in response.raw_headers]
    return b"\r\n".join([*lines, b"connection: close", b"", bytes(response.body)])
