"""A wire in the process that breaks: it carries so many bytes, and then nothing until it is mended."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import httpx

CHUNK = 500


class CutWire(httpx.BaseTransport):
    """Serves records and blobs as `ReleaseServer` does, as long as there are bytes left.

    Args:
        records: `NAME/versions/VERSION`, `NAME/pointers/SELECTOR` -> body.
        blobs: sha256 -> bytes.

    Attributes:
        left: Bytes that it still carries; None: any number.
        carried: Bytes that it carried.
    """

    def __init__(self, records: Mapping[str, bytes], blobs: Mapping[str, bytes]) -> None:
        self.records, self.blobs = records, blobs
        self.left: int | None = None
        self.carried = 0

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """Answers, or fails in the middle of it."""
        if self.left is not None and self.left <= 0:
            raise httpx.ConnectError("cut", request=request)
        path = request.url.path
        if path.startswith("/v1/models/"):
            body = self.records[path.removeprefix("/v1/models/")]
            return httpx.Response(200, stream=_Body(self, body))
        body = self.blobs[path.removeprefix("/v1/blobs/sha256/")]
        start = int(request.headers.get("Range", "bytes=0-").removeprefix("bytes=").removesuffix("-"))
        headers = {"Content-Range": f"bytes {start}-{len(body) - 1}/{len(body)}"} if start else {}
        return httpx.Response(206 if start else 200, stream=_Body(self, body[start:]), headers=headers)


class _Body(httpx.SyncByteStream):
    def __init__(self, wire: CutWire, content: bytes) -> None:
        self._wire, self._content = wire, content

    def __iter__(self) -> Iterator[bytes]:
        for first in range(0, len(self._content), CHUNK):
            chunk = self._content[first : first + CHUNK]
            if self._wire.left is not None:
                chunk = chunk[: self._wire.left]
                self._wire.left -= len(chunk)
            self._wire.carried += len(chunk)
            yield chunk
            if self._wire.left == 0:
                raise httpx.ReadError("cut")
