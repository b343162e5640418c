"""A receiver of webhooks: a real HTTP server that remembers what came, and answers as it is told."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from standardwebhooks import Webhook

LOOPBACK = "127.0.0.0/8"
"""Where it is: nowhere that a webhook may lead unless the settings say so."""


@dataclass(frozen=True)
class Message:
    """What came.

    Attributes:
        headers: By name in small letters.
        body: As it came.
        path: Path and query.
    """

    headers: dict[str, str]
    body: bytes
    path: str

    def verified(self, secret: str) -> Any:
        """The JSON of the body, as receivers verify it."""
        return Webhook(secret).verify(self.body, self.headers)


@dataclass
class Receiver:
    """The state behind the requests.

    Attributes:
        url: Of the server.
        messages: What came, in order.
        answers: Statuses of the next answers, the first of them taken each time; then 204.
        answer: Writes an answer by itself; None: a status.
    """

    url: str = ""
    messages: list[Message] = field(default_factory=list)
    answers: list[int] = field(default_factory=list)
    answer: Callable[[BaseHTTPRequestHandler], None] | None = None


@contextmanager
def receiver() -> Iterator[Receiver]:
    """A server on a free port of the loopback interface."""
    state = Receiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"]))
            headers = {name.lower(): value for name, value in self.headers.items()}
            state.messages.append(Message(headers, body, self.path))
            if state.answer is not None:
                state.answer(self)
                return
            self.send_response(state.answers.pop(0) if state.answers else 204)
            self.send_header("Location", f"{state.url}/elsewhere")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Says nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    state.url = f"http://127.0.0.1:{server.server_address[1]}"
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
