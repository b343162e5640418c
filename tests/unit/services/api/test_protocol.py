"""What a connection may hold before anybody knows who it is: over real sockets, to a server of the test's own."""

from __future__ import annotations

import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest
from support.api import Api
from support.workers import until

from schemas.limits import LIMITS
from services.api import protocol
from services.api.protocol import BoundedProtocol
from services.api.server import server_of

HEAD = b"GET /v1/health/live HTTP/1.1\r\nHost: localhost\r\n"


@contextmanager
def _connected(url: str) -> Iterator[socket.socket]:
    host, _, port = url.removeprefix("http://").partition(":")
    with socket.create_connection((host, int(port)), timeout=20.0) as connection:
        yield connection


def _is_alive(connection: socket.socket) -> bool:
    """Whether the server answers on a connection, whose answer may come in pieces."""
    connection.sendall(HEAD + b"\r\n")
    found = b""
    while not found.endswith(b'{"status":"live"}'):
        piece = connection.recv(1 << 16)
        if not piece:
            return False
        found += piece
    return found.startswith(b"HTTP/1.1 200 ")


def _rest(connection: socket.socket) -> bytes:
    """What comes until the server closes."""
    found = b""
    while True:
        try:
            piece = connection.recv(1 << 16)
        except ConnectionResetError:
            return found
        if not piece:
            return found
        found += piece


def _send(connection: socket.socket, piece: bytes, times: int) -> int:
    """How many bytes were sent before the server closed."""
    sent = 0
    try:
        for _ in range(times):
            connection.sendall(piece)
            sent += len(piece)
    except OSError:
        pass
    return sent


def _problem(answer: bytes) -> tuple[int, str]:
    head, _, body = answer.partition(b"\r\n\r\n")
    document = json.loads(body)
    assert b"application/problem+json" in head
    assert b"connection: close" in head.lower()
    return int(head.split()[1]), document["type"]


TOO_LARGE = (431, "/v1/problems/headers-too-large")


@pytest.mark.parametrize(
    "begin",
    [
        pytest.param(HEAD + b"X-Long: ", id="one header"),
        pytest.param(b"GET /v1/health/live?", id="an address"),
        pytest.param(b"", id="no request at all"),
        pytest.param(
            b"POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n1;x=",
            id="a chunk's frame",
        ),
        pytest.param(
            b"POST /v1/uploads HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n0\r\nX-Long: ",
            id="a trailer",
        ),
    ],
)
def test_what_never_ends_is_cut_off_before_it_is_held(api: Api, begin: bytes) -> None:
    with api.served() as url, _connected(url) as connection:
        piece = b"\r\n" * 8192 if not begin else b"x" * 16384
        connection.sendall(begin)
        most = 64
        assert _send(connection, piece, 16 * most) < most * len(piece) * 16
        connection.settimeout(10.0)
        _rest(connection)
    # The server is as well as before.
    assert api.get("/v1/health/live", None).status_code == 200


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ([(b"X-Many", b"y")] * LIMITS.headers, 431),
        ([(b"X-Many", b"y")] * (LIMITS.headers - 5), 200),
        ([(b"X-Long", b"y" * LIMITS.head_bytes)], 431),
        ([(b"X-Long", b"y" * (LIMITS.head_bytes - 500))], 200),
    ],
    ids=["too many", "many", "too long", "long"],
)
def test_headers_are_bounded_in_number_and_bytes(api: Api, headers: list[tuple[bytes, bytes]], status: int) -> None:
    with api.served() as url:
        answer = httpx.get(f"{url}/v1/health/live", headers=headers)
    assert answer.status_code == status
    if status == 431:
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.json()["type"] == TOO_LARGE[1]


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> float:
    """Seconds for a head."""
    monkeypatch.setattr(BoundedProtocol, "head_seconds", 0.6)
    return 0.6


@pytest.mark.parametrize("begin", [b"", b"\r\n", HEAD, b"GET"], ids=["silent", "blank", "half a head", "half a line"])
def test_a_connection_without_a_whole_request_is_closed(api: Api, hasty: float, begin: bytes) -> None:
    with api.served() as url, _connected(url) as connection:
        begun = time.monotonic()
        connection.sendall(begin)
        answer = _rest(connection)
        assert hasty - 0.2 < time.monotonic() - begun < 10.0
        if begin.startswith(b"GET"):
            assert _problem(answer) == (408, "/v1/problems/too-slow")
        else:
            assert answer == b""


def test_bytes_that_trickle_in_buy_no_time(api: Api, hasty: float) -> None:
    with api.served() as url, _connected(url) as connection:
        begun = time.monotonic()
        for byte in HEAD + b"X-Slow: " + b"x" * 200:
            time.sleep(0.05)
            if _send(connection, bytes([byte]), 1) == 0 or time.monotonic() - begun > 9.0:
                break
        assert time.monotonic() - begun < 8.0


def test_a_second_head_is_held_to_the_same(api: Api, hasty: float) -> None:
    """Its first byte ends the time for idle connections, which had begun with the first answer."""
    with api.served() as url, _connected(url) as connection:
        connection.sendall(HEAD + b"\r\n")
        assert connection.recv(1 << 16).startswith(b"HTTP/1.1 200")
        connection.sendall(b"G")
        begun = time.monotonic()
        assert _problem(_rest(connection)) == (408, "/v1/problems/too-slow")
        assert time.monotonic() - begun < 10.0


def test_a_body_that_nobody_waits_for_keeps_no_connection(api: Api, hasty: float) -> None:
    """Refused before it was read; each of its bytes ended the time for idle connections, and nothing began another."""
    with api.served() as url, _connected(url) as connection:
        connection.sendall(b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: 60000\r\n\r\n")
        assert connection.recv(1 << 16).startswith(b"HTTP/1.1 401")
        connection.sendall(b"x")
        begun = time.monotonic()
        _rest(connection)
        assert time.monotonic() - begun < 10.0


def test_a_connection_is_used_again_and_a_long_answer_is_not_cut_off(api: Api, hasty: float) -> None:
    job = api.job()
    with api.served() as url, httpx.Client(headers=api.headers("read"), timeout=60.0) as client:
        for _ in range(3):
            assert client.get(f"{url}/v1/jobs").status_code == 200
            time.sleep(0.1)
        stream = {"Accept": "text/event-stream"}
        with client.stream("GET", f"{url}/v1/jobs/{job}/events", headers=stream) as answer:
            lines = answer.iter_lines()
            next(lines)
            time.sleep(2.0 * hasty)
            api.move(job, "failed")
            assert "event: state" in list(lines)


def test_what_is_no_request_is_told_so_as_everything_else(api: Api) -> None:
    with api.served() as url, _connected(url) as connection:
        connection.sendall(b"\x16\x03\x01\x02\x00\r\n\r\n")
        assert _problem(_rest(connection)) == (400, "/v1/problems/malformed")


def test_an_answer_that_nobody_takes_is_given_up(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    """A closed connection waits until all is sent: with a peer that takes nothing that is for ever."""
    monkeypatch.setattr(BoundedProtocol, "send_stall_seconds", 0.5)
    monkeypatch.setattr("services.api.document.Response", _Long)
    with api.served() as url, _connected(url) as connection:
        connection.sendall(b"GET /v1/openapi.json HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        time.sleep(3.0)
        connection.settimeout(10.0)
        assert len(_rest(connection)) < _Long.SIZE


class _Long:
    """Stands for the document, longer than the system keeps for a socket."""

    SIZE = 32 << 20

    def __new__(cls, *_: object, **__: object) -> object:
        from fastapi import Response

        return Response(bytes(cls.SIZE))


def test_a_server_has_so_many_connections_and_no_more(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    with api.served() as url:
        monkeypatch.setattr(BoundedProtocol, "most_connections", 2)
        with _connected(url) as first, _connected(url) as second:
            for connection in (first, second):
                assert _is_alive(connection)
            with _connected(url) as third:
                assert _problem(_rest(third)) == (503, "/v1/problems/unavailable")
            assert _is_alive(first), "whoever is connected stays"


def test_a_request_on_a_connection_that_was_just_accepted_is_answered_by_a_server_that_stops(
    api: Api, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(protocol, "ARRIVAL_SECONDS", 20.0)
    server = server_of(api.app, "127.0.0.1", 0)
    thread = threading.Thread(target=server.run)
    thread.start()
    until(lambda: server.started)
    url = f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    with _connected(url) as connection:
        httpx.get(f"{url}/v1/health/live").raise_for_status()  # the connection before it was accepted by now
        server.should_exit = True
        until(lambda: not _is_listening(url))
        connection.sendall(HEAD + b"\r\n")
        answer = _rest(connection)
    assert answer.startswith(b"HTTP/1.1 200 ")
    assert b"connection: close" in answer.lower()
    thread.join(20.0)
    assert not thread.is_alive()


def _is_listening(url: str) -> bool:
    try:
        with _connected(url):
            return True
    except ConnectionRefusedError:
        return False
