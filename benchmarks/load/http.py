"""A small HTTP/1.1 client: one keep-alive connection, little work for each answer, so that the server is measured."""

from __future__ import annotations

import asyncio
import hashlib
import json
import re
import time
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Self

HOST = "127.0.0.1"
LIMIT = 1 << 20
TIMEOUT_SECONDS = 60.0

_NEXT = re.compile(r'<([^>]+)>; rel="next"')
_NO_BODY = (204, 304)


class ClientError(Exception):
    """The answer is not HTTP, or ended too early."""


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer.

    Attributes:
        status: HTTP status.
        headers: By name in small letters.
        body: The body, unless only its hash was asked for.
        bytes: Of the body.
        sha256: Hex digest of the body, if it was asked for.
        first: Seconds until the headers were there.
        seconds: Seconds until all was there.
    """

    status: int
    headers: Mapping[str, str]
    body: bytes
    bytes: int
    sha256: str | None
    first: float
    seconds: float

    def json(self) -> Any:
        """The body as JSON."""
        return json.loads(self.body)

    @property
    def next(self) -> str | None:
        """Address of the next page."""
        match = _NEXT.search(self.headers.get("link", ""))
        return match[1] if match else None


@dataclass
class Connection:
    """A connection that is opened when it is needed, and again when the server closed it.

    Attributes:
        port: Of the server, on the loopback interface.
        key: API key; empty: none.
        reused: Whether the next request goes over a connection that was used before.
    """

    port: int
    key: str = ""
    reused: bool = False
    _reader: asyncio.StreamReader | None = None
    _writer: asyncio.StreamWriter | None = field(default=None, repr=False)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes it; the next request opens another."""
        if self._writer is not None:
            self._writer.close()
        self._reader = self._writer = None
        self.reused = False

    async def request(
        self,
        method: str,
        path: str,
        *,
        headers: Mapping[str, str] | None = None,
        document: Any = None,
        digest: bool = False,
        keep: bool = True,
    ) -> Answer:
        """Sends a request and reads the whole answer.

        Args:
            method: HTTP method.
            path: With the query.
            headers: Further ones.
            document: JSON body.
            digest: Whether the body is hashed.
            keep: Whether the body is kept.

        Raises:
            ClientError: The answer ended too early.
            OSError: The server cannot be reached.
            TimeoutError: It took more than a minute.
        """
        begun = time.perf_counter()
        try:
            async with asyncio.timeout(TIMEOUT_SECONDS):
                status, found = await self._begin(method, path, headers or {}, document)
                first = time.perf_counter() - begun
                body, size, sha256 = await self._body(method, status, found, digest, keep)
        except BaseException:
            self.close()
            raise
        if found.get("connection", "").lower() == "close":
            self.close()
        return Answer(status, found, body, size, sha256, first, time.perf_counter() - begun)

    async def events(self, path: str, headers: Mapping[str, str]) -> AsyncIterator[tuple[int, dict[str, Any]]]:
        """Server-sent events: number and record of each, until the server ends the stream. 204 gives none.

        Raises:
            ClientError: The answer is another, or was cut off.
        """
        status, found = await self._begin("GET", path, {"Accept": "text/event-stream", **headers}, None)
        if status == 204:
            return
        if status != 200 or found.get("transfer-encoding") != "chunked":
            raise ClientError(f"events answered {status}")
        text = b""
        while chunk := await self._chunk():
            text += chunk
            *messages, text = text.split(b"\n\n")
            for message in messages:
                fields = dict(line.split(b": ", 1) for line in message.split(b"\n") if not line.startswith(b":"))
                if b"data" in fields:
                    yield int(fields[b"id"]), json.loads(fields[b"data"])

    async def _begin(
        self, method: str, path: str, headers: Mapping[str, str], document: Any
    ) -> tuple[int, dict[str, str]]:
        content = b"" if document is None else json.dumps(document).encode()
        lines = [f"{method} {path} HTTP/1.1", f"Host: {HOST}:{self.port}"]
        lines += [f"{name}: {value}" for name, value in headers.items()]
        if self.key:
            lines.append(f"Authorization: Bearer {self.key}")
        if document is not None:
            lines += ["Content-Type: application/json", f"Content-Length: {len(content)}"]
        message = "\r\n".join([*lines, "", ""]).encode() + content
        if self._writer is not None:  # a connection that was idle for long may have been closed meanwhile
            self.reused = True
        else:
            self._reader, self._writer = await asyncio.open_connection(HOST, self.port, limit=LIMIT)
        assert self._reader is not None
        self._writer.write(message)
        try:
            head = await self._reader.readuntil(b"\r\n\r\n")
        except asyncio.IncompleteReadError as error:
            raise ClientError(f"the connection ended after {len(error.partial)} bytes of headers") from None
        first, *rest = head.decode("latin-1").split("\r\n")
        pairs = (line.partition(": ") for line in rest if line)
        return int(first.split()[1]), {name.lower(): value for name, _, value in pairs}

    async def _body(
        self, method: str, status: int, headers: Mapping[str, str], digest: bool, keep: bool
    ) -> tuple[bytes, int, str | None]:
        assert self._reader is not None
        left = 0 if method == "HEAD" or status in _NO_BODY else int(headers["content-length"])
        size, chunks, sha256 = left, [], hashlib.sha256()
        while left:
            chunk = await self._reader.read(min(left, LIMIT))
            if not chunk:
                raise ClientError(f"{left} of {size} bytes are missing")
            left -= len(chunk)
            if digest:
                sha256.update(chunk)
            if keep:
                chunks.append(chunk)
        return b"".join(chunks), size, sha256.hexdigest() if digest else None

    async def _chunk(self) -> bytes:
        assert self._reader is not None
        try:
            size = int(await self._reader.readuntil(b"\r\n"), 16)
            return (await self._reader.readexactly(size + 2))[:-2]
        except asyncio.IncompleteReadError:
            raise ClientError("the events were cut off") from None
