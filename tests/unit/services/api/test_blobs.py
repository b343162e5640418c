from __future__ import annotations

import hashlib
import json
import os
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from typing import Any

import httpx
import pytest
from support.api import Api

from schemas.limits import LIMITS
from services.api import body as body_module
from services.api import uploads as uploads_module

DATA = bytes(range(100))
HASH = hashlib.sha256(DATA).hexdigest()
TAG = f'"{HASH}"'
PATH = f"/v1/blobs/sha256/{HASH}"


@pytest.fixture(scope="module")
def stored(shared: Api) -> Api:
    shared.service.storage.blobs.put_bytes(DATA)
    return shared


def test_a_file_is_sent_whole_with_what_a_cache_needs(stored: Api) -> None:
    answer = stored.get(PATH)
    assert (answer.status_code, answer.content) == (200, DATA)
    assert answer.headers["etag"] == TAG
    assert answer.headers["cache-control"] == "private, max-age=31536000, immutable"
    assert answer.headers["accept-ranges"] == "bytes"
    assert answer.headers["content-length"] == "100"
    assert answer.headers["content-type"] == "application/octet-stream"
    head = stored.request("HEAD", PATH)
    assert (head.status_code, head.content, head.headers["content-length"]) == (200, b"", "100")
    assert head.headers["etag"] == TAG


@pytest.mark.parametrize("known", [TAG, f"W/{TAG}", f'"a", {TAG}', "*"])
@pytest.mark.parametrize("method", ["GET", "HEAD"])
def test_a_client_that_has_it_gets_304(stored: Api, known: str, method: str) -> None:
    answer = stored.request(method, PATH, headers={"If-None-Match": known, "Range": "bytes=0-1"})
    assert (answer.status_code, answer.content, answer.headers["etag"]) == (304, b"", TAG)


def test_a_client_that_has_another_gets_it(stored: Api) -> None:
    assert stored.get(PATH, headers={"If-None-Match": f'"{"0" * 64}"'}).status_code == 200


@pytest.mark.parametrize(
    ("wanted", "start", "end"),
    [("0-0", 0, 1), ("10-19", 10, 20), ("90-", 90, 100), ("-5", 95, 100), ("-500", 0, 100), ("50-5000", 50, 100)],
)
def test_a_range(stored: Api, wanted: str, start: int, end: int) -> None:
    answer = stored.get(PATH, headers={"Range": f"bytes={wanted}"})
    assert (answer.status_code, answer.content) == (206, DATA[start:end])
    assert answer.headers["content-range"] == f"bytes {start}-{end - 1}/100"
    assert answer.headers["content-length"] == str(end - start)


@pytest.mark.parametrize("wanted", ["100-", "200-300", "-0"])
def test_a_range_outside(stored: Api, wanted: str) -> None:
    answer = stored.get(PATH, headers={"Range": f"bytes={wanted}"})
    assert (answer.status_code, answer.headers["content-range"]) == (416, "bytes */100")
    assert answer.json()["type"] == "/v1/problems/range-not-satisfiable"


@pytest.mark.parametrize("wanted", ["bytes=0-1,5-6", "bytes=5-1", "bytes=-", "bytes=a-b", "lines=0-1", "bytes 0-1"])
def test_what_is_not_one_range_is_answered_with_the_whole(stored: Api, wanted: str) -> None:
    answer = stored.get(PATH, headers={"Range": wanted})
    assert (answer.status_code, answer.content) == (200, DATA)


@pytest.mark.parametrize(
    ("condition", "status"), [(TAG, 206), (f"W/{TAG}", 200), ('"other"', 200), ("Wed, 21 Oct 2026 07:28:00 GMT", 200)]
)
def test_a_range_of_something_else_is_not_meant(stored: Api, condition: str, status: int) -> None:
    answer = stored.get(PATH, headers={"Range": "bytes=0-1", "If-Range": condition})
    assert answer.status_code == status


@pytest.mark.parametrize(
    ("path", "status"), [("0" * 64, 404), (HASH.upper(), 404), ("..%2f..%2fetc%2fpasswd", 404), (HASH[:63], 404)]
)
def test_only_hashes_name_files(stored: Api, path: str, status: int) -> None:
    assert stored.get(f"/v1/blobs/sha256/{path}").status_code == status


def test_a_damaged_file_is_not_sent(api: Api) -> None:
    api.service.storage.blobs.put_bytes(DATA)
    path = api.service.storage.blobs.path(HASH)
    path.chmod(0o644)
    path.write_bytes(b"x" * 100)
    os.utime(path, (1, 1))
    assert api.get(PATH).status_code == 404


def test_which_files_are_missing(stored: Api) -> None:
    asked = ["1" * 64, HASH, "2" * 64, "1" * 64]
    answer = stored.post("/v1/blobs/missing", json={"sha256": asked})
    assert answer.json() == {"missing": ["1" * 64, "2" * 64]}


def test_an_empty_file_and_one_of_many_pieces(api: Api) -> None:
    blobs = api.service.storage.blobs
    large = os.urandom((5 << 20) + 7)
    with api.served() as url, httpx.Client(headers=api.headers("read"), timeout=60.0) as client:
        for data in (b"", large):
            sha256 = blobs.put_bytes(data).sha256
            assert client.get(f"{url}/v1/blobs/sha256/{sha256}").content == data
        headers = {"Range": f"bytes={(2 << 20) - 1}-{(3 << 20) + 1}"}
        part = client.get(f"{url}/v1/blobs/sha256/{sha256}", headers=headers)
        assert part.content == large[(2 << 20) - 1 : (3 << 20) + 2]
        assert client.head(f"{url}/v1/blobs/sha256/{sha256}").headers["content-length"] == str(len(large))


def _send(api: Api, upload: dict[str, Any], offset: int, part: bytes) -> Any:
    headers = {"Upload-Offset": str(offset), "Content-Type": "application/octet-stream"}
    return api.request("PATCH", f"/v1/uploads/{upload['id']}", "submit", content=part, headers=headers)


def test_an_upload_in_parts(api: Api) -> None:
    begun = api.post("/v1/uploads", json={"sha256": HASH, "bytes": 100})
    assert (begun.status_code, begun.headers["location"]) == (201, f"/v1/uploads/{begun.json()['id']}")
    upload = begun.json()
    assert upload["part_bytes"] == LIMITS.part_bytes
    assert _send(api, upload, 0, DATA[:30]).json()["received"] == 30
    wrong = _send(api, upload, 0, DATA[:30])
    assert (wrong.status_code, wrong.json()["received"]) == (409, 30)
    assert api.get(f"/v1/uploads/{upload['id']}").json()["received"] == 30
    assert _send(api, upload, 30, DATA[30:]).json()["complete"]
    assert api.get(PATH).content == DATA
    again = api.post("/v1/uploads", json={"sha256": HASH, "bytes": 100})
    assert (again.status_code, again.json()["complete"]) == (200, True)


def test_uploads_that_are_refused(api: Api) -> None:
    upload = api.post("/v1/uploads", json={"sha256": "1" * 64, "bytes": 100}).json()
    assert _send(api, upload, 0, DATA).status_code == 422
    assert _send(api, upload, 0, DATA).status_code == 404
    assert api.post("/v1/uploads", json={"sha256": HASH, "bytes": LIMITS.upload_bytes + 1}).status_code == 422
    upload = api.post("/v1/uploads", json={"sha256": HASH, "bytes": LIMITS.upload_bytes}).json()
    assert _send(api, upload, 0, bytes(LIMITS.part_bytes + 1)).status_code == 413
    path = f"/v1/uploads/{upload['id']}"
    assert api.request("PATCH", path, json={}, headers={"Upload-Offset": "0"}).status_code == 415
    octets = {"Content-Type": "application/octet-stream"}
    assert api.request("PATCH", path, content=b"x", headers=octets).status_code == 422
    assert api.request("DELETE", path, "submit").status_code == 204
    assert api.get(path).status_code == 404


OCTETS = {"Content-Type": "application/octet-stream", "Upload-Offset": "0"}


def _begin(api: Api, scope: str, sha256: str = "1" * 64) -> str:
    return str(api.post("/v1/uploads", scope, json={"sha256": sha256, "bytes": 100 << 20}).json()["id"])


@contextmanager
def _waiting(url: str, api: Api, path: str, scope: str, announced: int = LIMITS.part_bytes) -> Iterator[socket.socket]:
    """A part of which one byte came."""
    host, _, port = url.removeprefix("http://").partition(":")
    lines = [f"PATCH {path} HTTP/1.1", "Host: localhost", f"Content-Length: {announced}"]
    lines += [f"{name}: {value}" for name, value in (OCTETS | api.headers(scope)).items()]
    with socket.create_connection((host, int(port)), timeout=20.0) as connection:
        connection.sendall("\r\n".join([*lines, "", "x"]).encode())
        yield connection


def test_parts_that_wait_leave_room_for_other_keys(api: Api) -> None:
    path = f"/v1/uploads/{_begin(api, 'submit')}"
    other = _begin(api, "admin", HASH)
    with api.served() as url, ExitStack() as waiting:
        connections = [waiting.enter_context(_waiting(url, api, path, "submit")) for _ in range(16)]
        time.sleep(1.0)
        answer = httpx.patch(
            f"{url}/v1/uploads/{other}", content=DATA, headers=OCTETS | api.headers("admin"), timeout=20.0
        )
        assert (answer.status_code, answer.json()["received"]) == (200, 100)
        refused = 0
        for connection in connections:
            connection.setblocking(False)
            with suppress(BlockingIOError):
                refused += connection.recv(1 << 16).startswith(b"HTTP/1.1 503")
        assert refused == 12  # one key has a quarter


def test_what_names_no_upload_takes_no_room(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads_module, "_parts", uploads_module._Memory(0, 0))
    part = {"content": b"x", "headers": OCTETS}
    assert api.request("PATCH", f"/v1/uploads/upl_{'0' * 24}", "submit", **part).status_code == 404
    own = _begin(api, "submit")
    refused = api.request("PATCH", f"/v1/uploads/{own}", "submit", **part)
    assert (refused.status_code, refused.headers["retry-after"]) == (503, "2")


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(body_module, "LIMITS", replace(LIMITS, body_stall_seconds=0.5, body_rate=1000))


def _status(connection: socket.socket) -> tuple[int, str]:
    answer = b""
    while piece := connection.recv(1 << 16):
        answer += piece
    head, _, body = answer.partition(b"\r\n\r\n")
    return int(head.split()[1]), json.loads(body)["type"]


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("announced", [LIMITS.part_bytes, 10])
def test_a_body_that_stops_is_given_up(api: Api, announced: int) -> None:
    path = f"/v1/uploads/{_begin(api, 'submit')}"
    with api.served() as url, _waiting(url, api, path, "submit", announced) as connection:
        begun = time.monotonic()
        assert _status(connection) == (408, "/v1/problems/too-slow")
        assert time.monotonic() - begun < 10.0


@pytest.mark.usefixtures("hasty")
def test_a_body_that_trickles_in_is_given_up(api: Api) -> None:
    """Each byte comes in time, and all of them would take a year."""
    path = f"/v1/uploads/{_begin(api, 'submit')}"
    with api.served() as url, _waiting(url, api, path, "submit") as connection:
        begun = time.monotonic()
        with suppress(OSError):
            while time.monotonic() - begun < 8.0:
                connection.sendall(b"x")
                time.sleep(0.1)
        assert time.monotonic() - begun < 6.0


@pytest.mark.usefixtures("hasty")
def test_a_slow_body_within_the_rate_is_taken(api: Api) -> None:
    upload = _begin(api, "submit")

    def body() -> Iterator[bytes]:
        for _ in range(6):
            yield b"x" * 1000
            time.sleep(0.2)

    with api.served() as url:
        headers = OCTETS | api.headers("submit")
        answer = httpx.patch(f"{url}/v1/uploads/{upload}", content=body(), headers=headers, timeout=20.0)
    assert (answer.status_code, answer.json()["received"]) == (200, 6000)
