"""`watch` gives a renderer every new bundle, survives whatever the server does, and stops when it is told to."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.release_server import KEY, ReleaseServer
from support.releases import STRANGER, Record, pointer_to, publish, serve, state

from diaphane_client import Denied, NotFound, Unavailable, pulling, watch
from diaphane_client import server as client_server

EVERY = 0.02


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ReleaseServer]:
    monkeypatch.setattr(client_server, "FIRST_WAIT", 0.001)
    found = ReleaseServer()
    yield found
    found.stop()


class Watched:
    """A watch in a thread of its own, as a renderer has it."""

    def __init__(self, server: ReleaseServer, tmp_path: Path, **options: Any) -> None:
        self.found: list[str] = []
        self.stop = threading.Event()
        options = {"url": server.url, "key": KEY, "folder": tmp_path / "bundles", "every": EVERY, **options}
        self._bundles = watch("glass", stop=self.stop, **options)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        for folder in self._bundles:
            assert (folder / "manifest.json").is_file()
            self.found.append(folder.name)

    def until(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + 30.0
        while not done():
            assert self._thread.is_alive()
            assert time.monotonic() < end
            time.sleep(0.005)

    def until_asked(self, server: ReleaseServer, times: int = 3) -> None:
        """Until it has asked some more times."""
        before = len(server.requests)
        self.until(lambda: len(server.requests) >= before + times)

    def __enter__(self) -> Watched:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop.set()
        self._thread.join(30.0)
        assert not self._thread.is_alive()


def test_every_new_bundle_is_given_once(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    with Watched(server, tmp_path) as watched:
        watched.until(lambda: watched.found == ["1.0.0"])
        watched.until_asked(server)
        assert all(path.endswith("/pointers/champion") for path, _ in server.requests[-2:])
        publish(server, tmp_path, "1.1.0")
        watched.until(lambda: watched.found == ["1.0.0", "1.1.0"])
        watched.until_asked(server)
    assert watched.found == ["1.0.0", "1.1.0"]
    asked = len(server.requests)
    time.sleep(5 * EVERY)
    assert len(server.requests) == asked


def test_a_server_that_fails_lies_or_goes_away_is_asked_on_and_logged_once(
    server: ReleaseServer, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    older = pointer_to(publish(server, tmp_path, "1.0.0"))
    good = publish(server, tmp_path, "1.1.0")

    def down() -> None:
        server.status = 503

    def locked_out() -> None:
        server.status = 403

    def never_modified() -> None:
        server.status = 304

    def unsigned() -> None:
        state(server, {**pointer_to(good), "signature": ""})

    def replayed() -> None:
        state(server, older)

    def expired() -> None:
        state(server, pointer_to(good, issued=time.time() - 10_000.0))

    def of_another_key() -> None:
        publish(server, tmp_path, "1.2.0", signer=STRANGER)

    def damaged() -> None:
        record: Record = publish(server, tmp_path, "1.2.0")
        sha256 = record["files"]["predict.glsl"]["sha256"]
        server.blobs[sha256] = b"?" + server.blobs[sha256][1:]

    def said() -> list[str]:
        return [record.message for record in caplog.records if record.name.startswith("diaphane_client")]

    with Watched(server, tmp_path) as watched:
        watched.until(lambda: watched.found == ["1.1.0"])
        for trouble in (down, locked_out, never_modified, unsigned, replayed, expired, of_another_key, damaged):
            caplog.clear()
            trouble()
            watched.until(lambda: bool(said()))
            watched.until_asked(server, 6)
            assert watched.found == ["1.1.0"]
            assert len(said()) == 1
            assert said()[0].startswith("'glass' champion stays as it is, 1.1.0: ")
            server.status = None
            serve(server, good)
            watched.until_asked(server)
        publish(server, tmp_path, "1.3.0")
        watched.until(lambda: watched.found == ["1.1.0", "1.3.0"])


def test_a_clock_that_is_wrong_is_said_once_though_time_goes_on(
    server: ReleaseServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    good = publish(server, tmp_path, "1.0.0")
    with Watched(server, tmp_path) as watched:
        watched.until(lambda: watched.found == ["1.0.0"])
        seconds = itertools.count(int(time.time()) + 10**6)
        monkeypatch.setattr(pulling, "time", SimpleNamespace(time=lambda: next(seconds)))
        for _ in range(3):
            state(server, pointer_to(good, issued=next(seconds) - 10**6))
            watched.until_asked(server, 4)
        monkeypatch.undo()
    said = [record.message for record in caplog.records if record.name.startswith("diaphane_client")]
    assert [message.count("expired at") for message in said] == [1]


def test_a_rollback_is_followed(server: ReleaseServer, tmp_path: Path) -> None:
    old = publish(server, tmp_path, "1.0.0")
    publish(server, tmp_path, "1.1.0")
    with Watched(server, tmp_path) as watched:
        watched.until(lambda: watched.found == ["1.1.0"])
        serve(server, old)
        watched.until(lambda: watched.found == ["1.1.0", "1.0.0"])


def test_it_begins_without_a_server_where_there_is_a_bundle(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    with Watched(server, tmp_path) as first:
        first.until(lambda: first.found == ["1.0.0"])
    server.stop()
    with Watched(server, tmp_path) as second:
        second.until(lambda: second.found == ["1.0.0"])
        server.start()
        publish(server, tmp_path, "1.1.0")
        second.until(lambda: second.found == ["1.0.0", "1.1.0"])


def test_what_is_wrong_from_the_beginning_is_raised(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    options: dict[str, Any] = {"url": server.url, "key": KEY, "folder": tmp_path / "bundles"}
    with pytest.raises(NotFound):
        next(watch("crystal", **options))
    with pytest.raises(Denied):
        next(watch("glass", **{**options, "key": None}))
    for every in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="positive"):
            next(watch("glass", every=every, **options))
    server.stop()
    with pytest.raises(Unavailable):
        next(watch("glass", **options))


def test_it_ends_when_it_is_stopped_and_when_it_is_left(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.0.0")
    options: dict[str, Any] = {"url": server.url, "key": KEY, "folder": tmp_path / "bundles", "every": 1000.0}
    stop = threading.Event()
    bundles = watch("glass", stop=stop, **options)
    assert next(bundles).name == "1.0.0"
    stop.set()
    assert list(bundles) == []
    assert [folder.name for folder in itertools.islice(watch("glass", **options), 1)] == ["1.0.0"]
    waiting = threading.Event()
    thread = threading.Thread(target=lambda: list(watch("glass", stop=waiting, **options)), daemon=True)
    asked = len(server.requests)
    thread.start()
    end = time.monotonic() + 30.0
    while len(server.requests) == asked:
        assert time.monotonic() < end
        time.sleep(0.005)
    waiting.set()  # in the middle of the long wait
    thread.join(30.0)
    assert not thread.is_alive()
