"""Responses that are sent piece by piece."""

from __future__ import annotations

import os
from collections.abc import AsyncIterator, Mapping
from contextlib import aclosing
from pathlib import Path
from typing import IO, Any

import anyio
from anyio import to_thread
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from schemas.limits import LIMITS
from services.api.leases import Holder, Leases, revocable

CHUNK = 1 << 20
"""Bytes of a file that are read and sent at once: enough that system calls and hand-overs cost little."""

STALL_SECONDS = LIMITS.send_stall_seconds
"""A client that takes nothing for so long is given up."""


class EventStream(Response):
    """Server-sent events; ends when the source does, or when the client goes.

    Args:
        source: Pieces of text.
    """

    media_type = "text/event-stream"

    def __init__(self, source: AsyncIterator[bytes]) -> None:
        super().__init__(headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"})
        del self.headers["content-length"]
        self._source: Any = source

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends the events, while the key and the session are valid that they are for."""
        leases: Leases = scope["app"].state.leases
        holder: Holder = scope["state"]["holder"]
        with leases.listen(holder):
            async with anyio.create_task_group() as group:

                async def watch() -> None:
                    while (await receive())["type"] != "http.disconnect":
                        pass
                    group.cancel_scope.cancel()

                await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
                group.start_soon(watch)
                with revocable(scope, ends_in_doubt=bool(holder.session)):
                    await self._relay(send)
                with anyio.fail_after(STALL_SECONDS):
                    await send({"type": "http.response.body", "body": b"", "more_body": False})
                group.cancel_scope.cancel()

    async def _relay(self, send: Send) -> None:
        async with aclosing(self._source) as source:
            async for text in source:
                with anyio.fail_after(STALL_SECONDS):
                    await send({"type": "http.response.body", "body": text, "more_body": True})


class FileRange(Response):
    """Bytes of a file.

    Args:
        path: The file.
        start: First byte.
        end: After the last byte.
        status: 200 or 206.
        headers: Beside the length.
    """

    media_type = "application/octet-stream"

    def __init__(self, path: Path, start: int, end: int, status: int, headers: Mapping[str, str]) -> None:
        super().__init__(status_code=status, headers={**headers, "Content-Length": str(end - start)})
        self._path, self._start, self._end = path, start, end

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends the bytes; reading happens in threads of its own, so that a slow disk holds up nothing else.

        Where the key is revoked meanwhile, the answer stays without its end, and the server closes the connection.
        """
        with revocable(scope):
            await self._send(send)

    async def _send(self, send: Send) -> None:
        stream: IO[bytes] = await to_thread.run_sync(self._path.open, "rb", 0)
        try:
            await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
            position = self._start
            while position < self._end:
                size = min(CHUNK, self._end - position)
                chunk = await to_thread.run_sync(os.pread, stream.fileno(), size, position)
                if not chunk:
                    raise OSError("a file became shorter while it was sent")
                position += len(chunk)
                with anyio.fail_after(STALL_SECONDS):
                    await send({"type": "http.response.body", "body": chunk, "more_body": position < self._end})
            if self._start == self._end:
                await send({"type": "http.response.body", "body": b"", "more_body": False})
        finally:
            stream.close()
