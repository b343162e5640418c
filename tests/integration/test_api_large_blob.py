"""A blob of many pieces over a real connection. How fast that is: `python -m benchmarks.service_load --parts blobs`."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import httpx
from support.api import Api

SIZE = (64 << 20) + 1


def test_a_blob_of_many_pieces_arrives_whole(tmp_path: Path) -> None:
    api = Api(tmp_path)
    large = api.service.settings.state / "large"
    large.write_bytes(os.urandom(1 << 20) * (SIZE >> 20) + b"\n")
    sha256 = api.service.storage.blobs.put_file(large).sha256
    found, size = hashlib.sha256(), 0
    with (
        api.served() as url,
        httpx.stream("GET", f"{url}/v1/blobs/sha256/{sha256}", headers=api.headers("read")) as answer,
    ):
        assert answer.status_code == 200
        assert int(answer.headers["content-length"]) == SIZE
        for piece in answer.iter_bytes():
            found.update(piece)
            size += len(piece)
    assert (found.hexdigest(), size) == (sha256, SIZE)
