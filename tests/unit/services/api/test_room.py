"""A disk that is full, and a store that is away: told as what they are, and ready again by themselves."""

from __future__ import annotations

import errno
import hashlib
import os
import shutil
import time
from collections import namedtuple
from pathlib import Path

import pytest
import sqlalchemy as sa
from psycopg.errors import DiskFull
from sqlalchemy.exc import OperationalError
from support.api import Api, build_spec
from support.dashboard import Visitor

from services.api import health as module
from services.database.connection import is_full

DATA = b"x" * 100
HASH = hashlib.sha256(DATA).hexdigest()
PART = {"Upload-Offset": "0", "Content-Type": "application/octet-stream"}
Usage = namedtuple("Usage", "total used free")


@pytest.fixture(autouse=True)
def look_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_KEPT_SECONDS", 0.0)
    monkeypatch.setattr(module, "_FULL_SECONDS", 3600.0)


def _ready(api: Api) -> tuple[int, bool, bool]:
    answer = api.get("/v1/health/ready", None)
    found = answer.json()
    assert (found["status"] == "ready") == (answer.status_code == 200)
    return answer.status_code, found["database"], found["store"]


def test_a_full_disk_is_told_with_a_remedy_and_nothing_is_lost(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    upload = api.post("/v1/uploads", json={"sha256": HASH, "bytes": 100}).json()["id"]

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        answer = api.request("PATCH", f"/v1/uploads/{upload}", "submit", content=DATA, headers=PART)
        assert (answer.status_code, answer.json()["type"]) == (507, "/v1/problems/storage-full")
        assert "make room" in answer.json()["remedy"]
        assert _ready(api)[0] == 503
    assert api.get(f"/v1/uploads/{upload}").json()["received"] == 0
    monkeypatch.setattr(module, "_FULL_SECONDS", 0.0)  # as if it were long ago
    assert _ready(api) == (200, True, True)
    done = api.request("PATCH", f"/v1/uploads/{upload}", "submit", content=DATA, headers=PART)
    assert done.json()["complete"]


def test_a_database_without_room_is_told_at_once(api: Api) -> None:
    """Truly full: SQLite may have no more pages than it has."""
    scene = api.scene()
    engine = api.service.database.engine

    def bound(connection: object, _: object) -> None:
        pages = connection.execute("pragma page_count").fetchone()[0]  # type: ignore[attr-defined]
        connection.execute(f"pragma max_page_count = {pages}")  # type: ignore[attr-defined]

    admin = Visitor(api)
    engine.dispose()
    sa.event.listen(engine, "connect", bound)
    spec = build_spec(scene, name="glass", priority="low")
    spec["scenes"][0]["views"] = [{"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 45}] * 900
    begun = time.monotonic()
    answer = api.post("/v1/jobs", json=spec)
    assert (answer.status_code, answer.json()["type"]) == (507, "/v1/problems/storage-full")
    assert time.monotonic() - begun < 10.0
    assert _ready(api)[0] == 503
    assert admin.get("/jobs").status_code == 200
    sa.event.remove(engine, "connect", bound)
    engine.dispose()
    assert api.post("/v1/jobs", json=spec).status_code == 202


def test_what_full_is() -> None:
    assert is_full(OperationalError("", None, DiskFull()))
    assert not is_full(OperationalError("", None, Exception("away")))


@pytest.mark.parametrize("place", ["store", "database"])
def test_a_disk_that_is_nearly_full_is_not_ready(api: Api, place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    usage, nearly = shutil.disk_usage, api.service.storage.blobs.root

    def found(path: Path) -> object:
        is_store = Path(path) == nearly
        return Usage(1, 1, 1 << 20) if is_store == (place == "store") else usage(path)

    monkeypatch.setattr(shutil, "disk_usage", found)
    assert _ready(api) == (503, place != "database", place != "store")


def test_a_store_that_is_away_is_not_ready_until_it_is_back(api: Api) -> None:
    blobs = api.service.storage.blobs
    blobs.put_bytes(DATA)
    assert _ready(api) == (200, True, True)
    away = blobs.root.rename(blobs.root.with_name("away"))
    assert _ready(api) == (503, True, False)
    answer = api.get(f"/v1/blobs/sha256/{HASH}")
    assert (answer.status_code, answer.json()["type"]) == (503, "/v1/problems/unavailable")
    assert int(answer.headers["retry-after"]) > 0
    assert api.post("/v1/blobs/missing", json={"sha256": [HASH]}).status_code == 503
    blobs.root.mkdir()  # where it was mounted
    assert _ready(api) == (503, True, False)
    blobs.root.rmdir()
    away.rename(blobs.root)
    assert _ready(api) == (200, True, True)
    assert api.get(f"/v1/blobs/sha256/{HASH}").content == DATA


def test_a_store_that_hangs_holds_one_thread(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    readiness = api.app.state.readiness
    monkeypatch.setattr(module, "_PATIENCE_SECONDS", 0.1)
    with readiness._lock:
        assert _ready(api) == (503, False, False)
    assert _ready(api) == (200, True, True)


def test_a_store_that_cannot_be_written_is_not_ready(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    write = Path.write_bytes

    def refuse(path: Path, data: bytes) -> int:
        if path.name.startswith("probe-"):
            raise OSError(errno.EROFS, "Read-only file system")
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", refuse)
    assert _ready(api) == (503, True, False)
