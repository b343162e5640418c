"""`/v1/blobs`: files by sha256. They never change, so whoever has one never has to ask again."""

from __future__ import annotations

import re
from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Depends, Request, Response

from services.api.answers import Hashes, Missing
from services.api.body import JsonBody
from services.api.etags import is_current
from services.api.parts import BlobHash, Services
from services.api.security import Needs
from services.api.streams import FileRange
from services.problems import Refusal
from services.storage import MissingBlob

router = APIRouter(prefix="/v1/blobs", tags=["blobs"])

_ONE_RANGE = re.compile(r"bytes=(\d{0,18})-(\d{0,18})")
_FILE: dict[str, Any] = {
    "description": "The file.",
    "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
}
_ANSWERS: dict[int | str, dict[str, Any]] = {
    200: _FILE,
    206: {**_FILE, "description": "The range that was asked for."},
    304: {"description": "The client has it."},
    416: {},
}
_PARAMETERS = {
    "parameters": [
        {"name": name, "in": "header", "required": False, "schema": {"type": "string"}, "description": text}
        for name, text in {
            "Range": "One range of bytes; several are answered with the whole file.",
            "If-Range": "The range is meant only if the ETag is this.",
            "If-None-Match": "ETags that the client has.",
        }.items()
    ]
}


@router.post("/missing", dependencies=[Depends(Needs("read"))])
def find_missing(body: Annotated[Hashes, Depends(JsonBody(Hashes))], service: Services) -> Missing:
    """Which of some files are not there, so that only those are uploaded."""
    wanted = list(dict.fromkeys(body.sha256))
    return Missing(missing=[sha256 for sha256 in wanted if not service.storage.blobs.has(sha256)])


@router.head(
    "/sha256/{sha256}", response_class=Response, responses={200: {"description": "It is there."}, 304: _ANSWERS[304]}
)
async def head_blob(sha256: BlobHash, request: Request, service: Services) -> Response:
    """Size and ETag of a file."""
    size = await _size(service, sha256)
    if is_current(request, sha256):
        return Response(status_code=304, headers=_headers(sha256))
    return Response(headers={**_headers(sha256), "Content-Length": str(size)}, media_type=FileRange.media_type)


@router.get("/sha256/{sha256}", response_class=Response, responses=_ANSWERS, openapi_extra=_PARAMETERS)
async def read_blob(sha256: BlobHash, request: Request, service: Services) -> Response:
    """A file, or one range of it."""
    size = await _size(service, sha256)
    headers = _headers(sha256)
    if is_current(request, sha256):
        return Response(status_code=304, headers=headers)
    wanted = _range(request, sha256, size)
    path = await to_thread.run_sync(service.storage.blobs.path, sha256)
    if wanted is None:
        return FileRange(path, 0, size, 200, headers)
    start, end = wanted
    return FileRange(path, start, end, 206, {**headers, "Content-Range": f"bytes {start}-{end - 1}/{size}"})


async def _size(service: Services, sha256: str) -> int:
    size = await to_thread.run_sync(service.storage.blobs.size, sha256)
    if size is None:
        raise MissingBlob(sha256)
    return size


def _headers(sha256: str) -> dict[str, str]:
    return {
        "ETag": f'"{sha256}"',
        "Accept-Ranges": "bytes",
        "Cache-Control": "private, max-age=31536000, immutable",
        "Content-Disposition": "attachment",
    }


def _range(request: Request, sha256: str, size: int) -> tuple[int, int] | None:
    """First byte and end of the range that is asked for; None: the whole file.

    Raises:
        Refusal: It lies outside the file.
    """
    if request.headers.get("if-range", f'"{sha256}"').strip() != f'"{sha256}"':
        return None
    match = _ONE_RANGE.fullmatch(request.headers.get("range", "").replace(" ", ""))
    if match is None or not (match[1] or match[2]):
        return None
    if match[1]:
        start, end = int(match[1]), min(size, int(match[2]) + 1 if match[2] else size)
        if match[2] and int(match[2]) < int(match[1]):
            return None  # RFC 9110: such a header is invalid, and ignored
    else:
        start, end = max(0, size - int(match[2])), size
    if start >= end:
        raise Refusal("range-not-satisfiable", headers={"Content-Range": f"bytes */{size}"})
    return start, end
