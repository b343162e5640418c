"""A small server of releases that can be told to misbehave: to lie, cut connections, forget ranges, be down."""

from __future__ import annotations

import threading
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

KEY = "dia_0123456789ab_" + "x" * 43


class ReleaseServer:
    """Serves records of versions, statements of what aliases mean, and blobs.

    Attributes:
        records: `NAME/versions/VERSION`, `NAME/pointers/SELECTOR` -> body.
        blobs: sha256 -> bytes; not checked.
        cuts: Bytes of blobs after which the next connections are cut, in order; later ones are not.
        ranges: Whether it knows ranges.
        status: Status of every answer; None: as it should be.
        requests: Path and headers of all requests so far.
    """

    def __init__(self) -> None:
        self.records: dict[str, bytes] = {}
        self.blobs: dict[str, bytes] = {}
        self.cuts: list[int] = []
        self.ranges = True
        self.status: int | None = None
        self.requests: list[tuple[str, dict[str, str]]] = []
        self._server: ThreadingHTTPServer | None = None
        self.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        """Starts it, on the port that it had before."""
        handler = type("Handler", (_Handler,), {"owner": self})
        self._server = _QuietServer(("127.0.0.1", getattr(self, "port", 0)), handler)
        self.port: int = self._server.server_address[1]
        threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    def stop(self) -> None:
        if self._server is not None:
            self._server.shutdown()
            self._server.server_close()
            self._server = None

    def blob_requests(self) -> list[dict[str, str]]:
        """Headers of the requests for blobs so far."""
        return [headers for path, headers in self.requests if "/blobs/" in path]


class _QuietServer(ThreadingHTTPServer):
    def handle_error(self, *_args: Any) -> None:
        """A client that hangs up is no error of this server."""


class _Handler(BaseHTTPRequestHandler):
    owner: ReleaseServer
    protocol_version = "HTTP/1.1"

    def log_message(self, *_args: Any) -> None:
        pass

    def do_GET(self) -> None:
        server = self.owner
        server.requests.append((self.path, dict(self.headers.items())))
        if server.status is not None:
            self._answer(server.status, b"")
        elif self.headers.get("Authorization") != f"Bearer {KEY}":
            self._answer(HTTPStatus.UNAUTHORIZED, b"")
        elif self.path.startswith("/v1/models/"):
            self._record(server.records.get(self.path.removeprefix("/v1/models/")))
        else:
            self._blob(server.blobs.get(self.path.removeprefix("/v1/blobs/sha256/")))

    def _record(self, body: bytes | None) -> None:
        self._answer(HTTPStatus.NOT_FOUND if body is None else HTTPStatus.OK, body or b"")

    def _blob(self, body: bytes | None) -> None:
        if body is None:
            self._answer(HTTPStatus.NOT_FOUND, b"")
            return
        asked = self.headers.get("Range") if self.owner.ranges else None
        start = int(asked.removeprefix("bytes=").removesuffix("-")) if asked else 0
        headers = {"Content-Range": f"bytes {start}-{len(body) - 1}/{len(body)}"} if asked else {}
        cut = self.owner.cuts.pop(0) if self.owner.cuts else None
        self._answer(HTTPStatus.PARTIAL_CONTENT if asked else HTTPStatus.OK, body[start:], headers, cut)

    def _answer(self, status: int, body: bytes, headers: dict[str, str] | None = None, cut: int | None = None) -> None:
        self.send_response(status)
        for name, value in (headers or {}).items():
            self.send_header(name, value)
        if status != HTTPStatus.NOT_MODIFIED:
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body if cut is None else body[:cut])
        if cut is not None:
            self.close_connection = True
