"""`/v1/uploads`: files in parts, that go on where they stopped."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Depends, Header, Request, Response

from schemas.limits import LIMITS
from services.api.answers import NewUpload, UploadState
from services.api.body import JsonBody, read_body, require_type
from services.api.parts import Services, UploadId
from services.api.security import Caller, Needs, require_own
from services.problems import Refusal
from services.uploads import Upload

IN_MEMORY_BYTES = 16 * LIMITS.part_bytes
"""Of all parts that are being received at once."""

KEY_BYTES = IN_MEMORY_BYTES // 4
"""Of the parts of one key."""

_LEAST_BYTES = 1 << 20
"""Set aside for any part, so that their number is bounded as well."""

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
    caller: Caller,
) -> UploadState:
    """Appends a part; the last one completes the upload if the hash holds."""
    require_type(request, "application/octet-stream")
    upload = await to_thread.run_sync(service.uploads.get, upload_id)  # before anything is set aside for it
    require_own(caller, upload.made_by, f"The upload {upload_id}")
    with _memory(request, caller.id):
        data = await read_body(request, LIMITS.part_bytes)
        return _state(await to_thread.run_sync(service.uploads.append, upload_id, upload_offset, data))


@router.delete("/{upload_id}", status_code=204, dependencies=_submit)
def delete_upload(upload_id: UploadId, service: Services, caller: Caller) -> None:
    """Gives an upload up."""
    require_own(caller, service.uploads.get(upload_id).made_by, f"The upload {upload_id}")
    service.uploads.delete(upload_id)


def _state(upload: Upload) -> UploadState:
    return UploadState(id=upload.id, received=upload.received, bytes=upload.bytes, complete=upload.complete)


class _Memory:
    """Bytes that parts under way may take, all together and those of one key."""

    def __init__(self, size: int, share: int) -> None:
        self._free, self._share = size, share
        self._taken: Counter[str] = Counter()
        self._lock = threading.Lock()

    @contextmanager
    def take(self, size: int, key_id: str) -> Iterator[None]:
        """Sets bytes aside.

        Raises:
            Refusal: There are not as many.
        """
        with self._lock:
            if self._taken[key_id] + size > self._share:
                raise Refusal("unavailable", "The key sends too many parts of uploads at once.", headers=_AGAIN)
            if size > self._free:
                raise Refusal("unavailable", "Too many parts of uploads are being received at once.", headers=_AGAIN)
            self._free -= size
            self._taken[key_id] += size
        try:
            yield
        finally:
            with self._lock:
                self._free += size
                self._taken[key_id] -= size
                if not self._taken[key_id]:
                    del self._taken[key_id]


_parts = _Memory(IN_MEMORY_BYTES, KEY_BYTES)
_AGAIN = {"Retry-After": "2"}


@contextmanager
def _memory(request: Request, key_id: str) -> Iterator[None]:
    """Memory for the body of a request: as announced, else as much as there may be."""
    announced = request.headers.get("content-length", "")
    size = int(announced[:20]) if announced.isdecimal() else LIMITS.part_bytes
    with _parts.take(max(_LEAST_BYTES, min(size, LIMITS.part_bytes)), key_id):
        yield
