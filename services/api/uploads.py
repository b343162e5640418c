"""`/v1/uploads`: files in parts, that go on where they stopped."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Depends, Header, Request, Response

from schemas.limits import LIMITS
from services.api.answers import NewUpload, UploadState
from services.api.body import JsonBody, read_body, require_type
from services.api.parts import Services, UploadId
from services.api.security import Caller, Needs
from services.problems import Refusal
from services.uploads import Upload

IN_MEMORY_BYTES = 16 * LIMITS.part_bytes
"""Of all parts that are being received at once."""

router = APIRouter(prefix="/v1/uploads", tags=["uploads"])
_submit = [Depends(Needs("submit"))]


@router.post("", status_code=201, dependencies=_submit, responses={200: {"model": UploadState}})
def begin_upload(
    body: Annotated[NewUpload, Depends(JsonBody(NewUpload))], service: Services, caller: Caller, response: Response
) -> UploadState:
    """Begins an upload, or goes on with an unfinished one of the same file; 200 if the file is there already."""
    upload = service.uploads.begin(body.sha256, body.bytes, caller.id)
    if upload is None:
        response.status_code = 200
        return UploadState(received=body.bytes, bytes=body.bytes, complete=True)
    response.headers["Location"] = f"/v1/uploads/{upload.id}"
    return _state(upload)


@router.get("/{upload_id}")
def read_upload(upload_id: UploadId, service: Services) -> UploadState:
    """How far an upload is."""
    return _state(service.uploads.get(upload_id))


@router.patch(
    "/{upload_id}",
    dependencies=_submit,
    responses={409: {}},
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def append_part(
    upload_id: UploadId,
    upload_offset: Annotated[int, Header(ge=0, le=LIMITS.upload_bytes)],
    request: Request,
    service: Services,
) -> UploadState:
    """Appends a part; the last one completes the upload if the hash holds."""
    require_type(request, "application/octet-stream")
    with _memory(request):
        data = await read_body(request, LIMITS.part_bytes)
        return _state(await to_thread.run_sync(service.uploads.append, upload_id, upload_offset, data))


@router.delete("/{upload_id}", status_code=204, dependencies=_submit)
def delete_upload(upload_id: UploadId, service: Services) -> None:
    """Gives an upload up."""
    service.uploads.delete(upload_id)


def _state(upload: Upload) -> UploadState:
    return UploadState(id=upload.id, received=upload.received, bytes=upload.bytes, complete=upload.complete)


class _Memory:
    """Bytes that parts under way may take together."""

    def __init__(self, size: int) -> None:
        self._free, self._lock = size, threading.Lock()

    @contextmanager
    def take(self, size: int) -> Iterator[None]:
        """Sets bytes aside.

        Raises:
            Refusal: There are not as many.
        """
        with self._lock:
            if size > self._free:
                raise Refusal("unavailable", "Too many parts of uploads are being received at once.")
            self._free -= size
        try:
            yield
        finally:
            with self._lock:
                self._free += size


_parts = _Memory(IN_MEMORY_BYTES)


@contextmanager
def _memory(request: Request) -> Iterator[None]:
    """Memory for the body of a request: as announced, else as much as there may be."""
    announced = request.headers.get("content-length", "")
    size = int(announced[:20]) if announced.isdecimal() else LIMITS.part_bytes
    with _parts.take(min(size, LIMITS.part_bytes)):
        yield
