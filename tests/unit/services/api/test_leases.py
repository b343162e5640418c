"""What is under way ends with its key: over real sockets, revoked by another process's means."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest
from sqlalchemy.exc import OperationalError
from support.api import Api

from services.api import leases as module
from services.database import open_database
from services.keys import Keys

STREAM = {"Accept": "text/event-stream"}
WITHIN = 2.0
"""Seconds from revoking to the end of a stream."""

LOOSE = 1.0
"""Seconds that a busy machine may add."""


@pytest.fixture
def api(database_url: str, tmp_path: Path) -> Api:
    return Api(tmp_path, database_url)


@contextmanager
def _stream(url: str, path: str, headers: dict[str, str]) -> Iterator[Iterator[str]]:
    with httpx.Client(timeout=20.0) as client, client.stream("GET", f"{url}{path}", headers=headers) as answer:
        assert answer.status_code == 200
        yield answer.iter_lines()


def _ends(lines: Iterator[str]) -> float:
    """When a stream ends, properly: a connection that breaks off is an error."""
    end = time.monotonic() + 10.0
    for _ in lines:
        assert time.monotonic() < end
    return time.monotonic()


def _bearer(secret: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {secret}"}


def _signed_in(url: str, secret: str) -> dict[str, str]:
    answer = httpx.post(f"{url}/sign-in", data={"key": secret}, headers={"Origin": url})
    assert answer.status_code == 303
    return {"Cookie": answer.headers["set-cookie"].partition(";")[0]}


def _until_listeners(api: Api, count: int) -> None:
    end = time.monotonic() + 10.0
    while api.app.state.leases.listeners != count:
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize("page", ["/v1/jobs/{job}/events", "/jobs/{job}/events", "/changes"])
def test_a_stream_ends_when_its_key_is_revoked_anywhere(api: Api, page: str, database_url: str) -> None:
    job = api.job()
    record, secret = api.service.keys.create("other", ["read"])
    with api.served() as url:
        headers = {**STREAM, **(_bearer(secret) if page.startswith("/v1") else _signed_in(url, secret))}
        with _stream(url, page.format(job=job), headers) as lines:
            next(lines)
            Keys(open_database(database_url)).revoke(record.id)
            revoked = time.monotonic()
            assert _ends(lines) - revoked < WITHIN + LOOSE
        _until_listeners(api, 0)


def test_a_stream_ends_when_its_key_expires(api: Api) -> None:
    job = api.job()
    expires = time.time() + 1.5
    _, secret = api.service.keys.create("short", ["read"], expires)
    with api.served() as url, _stream(url, f"/v1/jobs/{job}/events", {**STREAM, **_bearer(secret)}) as lines:
        next(lines)
        _ends(lines)
        assert 0.0 <= time.time() - expires < WITHIN + LOOSE


def test_a_stream_ends_with_the_session_alone(api: Api) -> None:
    """Signed out: the key, and its other sessions, go on."""
    with api.served() as url:
        one, other = (_signed_in(url, api.secrets["read"]) for _ in range(2))
        with (
            _stream(url, "/changes", {**STREAM, **other}) as kept,
            _stream(url, "/changes", {**STREAM, **one}) as lines,
        ):
            next(kept)
            next(lines)
            api.app.state.sessions.close(one["Cookie"].partition("=")[2])
            closed = time.monotonic()
            assert _ends(lines) - closed < WITHIN + LOOSE
            _until_listeners(api, 1)


def test_others_go_on(api: Api) -> None:
    job = api.job()
    record, secret = api.service.keys.create("other", ["read"])
    with (
        api.served() as url,
        _stream(url, f"/v1/jobs/{job}/events", {**STREAM, **_bearer(secret)}) as lines,
        _stream(url, f"/v1/jobs/{job}/events", {**STREAM, **api.headers("read")}) as kept,
    ):
        next(kept)
        api.service.keys.revoke(record.id)
        _ends(lines)
        api.move(job, "failed")
        assert "event: state" in list(kept)


def test_a_file_is_not_sent_on_for_a_revoked_key(api: Api) -> None:
    """A client that takes a little now and then could make a download last for days."""
    content = os.urandom(1 << 20) * 48
    sha256 = api.service.storage.blobs.put_bytes(content).sha256
    record, secret = api.service.keys.create("other", ["read"])
    with (
        api.served() as url,
        httpx.Client(timeout=20.0) as client,
        client.stream("GET", f"{url}/v1/blobs/sha256/{sha256}", headers=_bearer(secret)) as answer,
    ):
        pieces = answer.iter_raw(1 << 16)
        next(pieces)
        api.service.keys.revoke(record.id)
        time.sleep(WITHIN + LOOSE)
        with pytest.raises(httpx.RemoteProtocolError):
            sum(map(len, pieces))


def test_a_part_that_is_under_way_is_not_taken_of_a_revoked_key(api: Api) -> None:
    record, secret = api.service.keys.create("other", ["submit"])
    upload = api.service.uploads.begin("1" * 64, 100, record.id)
    assert upload is not None

    def body() -> Iterator[bytes]:
        yield b"x"
        api.service.keys.revoke(record.id)
        time.sleep(WITHIN + LOOSE)
        yield b"x" * 9

    headers = {**_bearer(secret), "Upload-Offset": "0", "Content-Type": "application/octet-stream"}
    with api.served() as url:
        answer = httpx.patch(f"{url}/v1/uploads/{upload.id}", content=body(), headers=headers, timeout=20.0)
    assert answer.status_code == 401
    assert api.service.uploads.get(upload.id).received == 0


def test_one_key_leaves_room_for_others_to_listen(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LISTENERS_PER_KEY", 3)
    path = f"/v1/jobs/{api.job()}/events"
    own, others = {**STREAM, **api.headers("read")}, {**STREAM, **api.headers("submit")}
    with api.served() as url:
        session = {**STREAM, **_signed_in(url, api.secrets["read"])}
        with (
            _stream(url, path, own) as first,
            _stream(url, path, own) as second,
            _stream(url, "/changes", session) as third,
        ):
            for lines in (first, second, third):
                next(lines)
            refused = httpx.get(f"{url}{path}", headers=own)
            assert (refused.status_code, refused.json()["type"]) == (429, "/v1/problems/too-many-requests")
            assert int(refused.headers["retry-after"]) > 0
            assert httpx.get(f"{url}/changes", headers=session).status_code == 429
            with _stream(url, path, others) as lines:
                next(lines)
        _until_listeners(api, 0)
        with _stream(url, path, own) as lines:
            next(lines)


def test_of_many_listeners_at_once_no_more_are_let_in(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of them finds room, if it looks before the others have sat down."""
    monkeypatch.setattr(module, "LISTENERS_PER_KEY", 3)
    path, headers = f"/v1/jobs/{api.job()}/events", {**STREAM, **api.headers("read")}
    statuses: list[int] = []
    done = threading.Event()

    def listen() -> None:
        with httpx.Client(timeout=20.0) as client, client.stream("GET", f"{url}{path}", headers=headers) as answer:
            statuses.append(answer.status_code)
            done.wait(20.0)

    with api.served() as url:
        threads = [threading.Thread(target=listen) for _ in range(12)]
        for thread in threads:
            thread.start()
        end = time.monotonic() + 15.0
        while len(statuses) < 12 and time.monotonic() < end:
            time.sleep(0.02)
        done.set()
        for thread in threads:
            thread.join()
    assert sorted(statuses) == [200] * 3 + [429] * 9


def test_all_keys_together_leave_the_server_standing(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LISTENERS", 0)
    answer = api.get(f"/v1/jobs/{api.job()}/events", headers=STREAM)
    assert (answer.status_code, answer.json()["type"]) == (503, "/v1/problems/unavailable")


@pytest.mark.parametrize("page", [False, True])
def test_while_the_database_is_away_clients_go_on_and_pages_ask(
    api: Api, page: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A page whose stream has ended loads itself, and says what is wrong."""
    job, away, leases = api.job(), threading.Event(), api.app.state.leases
    ask = leases._keys

    def valid(ids: set[str]) -> set[str]:
        if away.is_set():
            raise OperationalError("", None, Exception("away"))
        return set(ask(ids))

    monkeypatch.setattr(leases, "_keys", valid)
    with api.served() as url:
        headers = _signed_in(url, api.secrets["read"]) if page else api.headers("read")
        path = f"{'' if page else '/v1'}/jobs/{job}/events"
        with _stream(url, path, {**STREAM, **headers}) as lines:
            next(lines)
            away.set()
            time.sleep(2.5)
            away.clear()
            api.move(job, "failed")
            assert ('data: {"number": 2,' in "".join(lines)) == (not page)
