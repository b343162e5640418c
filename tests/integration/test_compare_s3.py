"""The page Compare over an object store: a pixel needs a few files of its artifacts, and only those are fetched."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlencode

import pytest
from support.api import Api
from support.compare import Filled, fill
from support.dashboard import Visitor

from services.dashboard.compare import Comparer
from services.storage.remote import Remote
from stages.store import Store

SIZE = (48, 32)
KEYS = {"a": "kbuffer:1", "b": "glass@1.0.0:1"}


class Wire:
    """Counts what comes from the object store, in requests and bytes."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.requests = self.bytes = 0
        get, part = Remote.get, Remote.range

        def counted_get(remote: Remote, key: str) -> tuple[bytes, float] | None:
            found = get(remote, key)
            self._count(len(found[0]) if found else 0)
            return found

        def counted_range(remote: Remote, key: str, start: int, end: int) -> Iterator[bytes]:
            for chunk in part(remote, key, start, end):
                self._count(len(chunk))
                yield chunk

        patch.setattr(Remote, "get", counted_get)
        patch.setattr(Remote, "range", counted_range)

    def _count(self, size: int) -> None:
        self.requests += 1
        self.bytes += size

    def take(self) -> tuple[int, int]:
        """Requests and bytes since the last time."""
        found = self.requests, self.bytes
        self.requests = self.bytes = 0
        return found


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    return Wire(monkeypatch)


@pytest.fixture
def api(s3_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Api:
    # As many chunks as a large view has.
    monkeypatch.setattr("renderer.dump._CHUNK", 128)
    monkeypatch.setattr("stages.allocations._CHUNK", 128)
    return Api(tmp_path, store=s3_url, rate=1e6, burst=10**6)


@pytest.fixture
def filled(api: Api) -> Filled:
    """Made by another machine: nothing of it is in the cache."""
    found, store = fill(api, SIZE), api.service.storage.store
    for view in found.views.values():
        for address in (view.render, view.label, *view.evaluations.values()):
            store.push(address)
            store.drop(address.artifact)
    return found


def _pixel(filled: Filled, x: int, y: int) -> str:
    return f"/compare/pixel?{urlencode({'scene': filled.scene, 'view': 'front', 'x': x, 'y': y, **KEYS})}"


def _whole(api: Api, filled: Filled) -> int:
    """Bytes of the fragments and labels that the two sides were made from."""
    view, sizes = filled.views["front"], {one.artifact: one.bytes for one in api.service.storage.store.artifacts()}
    return sizes[view.render.artifact] + sizes[view.label.artifact]


def test_a_pixel_fetches_a_few_files_and_keeps_them(api: Api, filled: Filled, wire: Wire) -> None:
    reader, whole = Visitor(api, "read"), _whole(api, filled)
    n = int(filled.views["front"].dump.counts[9 * SIZE[0] + 20])
    wire.take()
    page = reader.get(_pixel(filled, 20, 9)).text
    assert f"<dt>Fragments</dt><dd>{n};" in page
    assert re.search(r'scope="row">optimal</th><td>\d+</td>', page), "labels are read, too"
    requests, fetched = wire.take()
    assert 0 < fetched < 0.6 * whole  # of which most are the lists of files: the counts are read as a whole
    assert list(api.service.storage.store.cached()) == []
    assert reader.get(_pixel(filled, 20, 9)).text == page
    assert wire.take() == (0, 0)
    reader.get(_pixel(filled, 20, 30))
    again, more = wire.take()
    assert (0 < again < requests / 4, 0 < more < 0.1 * whole) == (True, True)
    assert list(api.service.storage.store.cached()) == []


def test_what_another_machine_removed_is_gone_and_what_it_made_again_is_read(
    api: Api, filled: Filled, tmp_path: Path, s3_url: str
) -> None:
    reader, view = Visitor(api, "read"), filled.views["front"]
    assert "Fragments, front to back" in reader.get(_pixel(filled, 20, 9)).text
    other = Api(tmp_path / "other", store=s3_url).service.storage.store
    folder = other.fetch(view.render.artifact)
    files = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    other.remove(view.render.artifact)
    assert "The fragments behind A and B were removed" in reader.get(_pixel(filled, 20, 9)).text
    with other.put(view.render) as again:
        for name, content in files.items():
            if name.name != "meta.json":
                (again / name).parent.mkdir(parents=True, exist_ok=True)
                (again / name).write_bytes(content)
    other.push(view.render)
    api.app.state.comparer = Comparer(api.service)  # nothing in memory, apart from where the files were
    assert "Fragments, front to back" in reader.get(_pixel(filled, 20, 9)).text


def test_a_file_read_by_itself_is_verified_and_a_stale_list_of_files_is_read_anew(
    api: Api, filled: Filled, tmp_path: Path, s3_url: str
) -> None:
    store, artifact = api.service.storage.store, filled.views["front"].evaluations[None].artifact
    content = store.read(artifact, "kbuffer-1.png")
    other = Api(tmp_path / "other", store=s3_url).service.storage.store
    folder, address = other.fetch(artifact), other.made_from(artifact)
    files = {path.name: path.read_bytes() for path in folder.iterdir()}
    other.remove(artifact)
    with other.put(address) as again:
        for name in ("kbuffer-1.png", "exact.png"):  # other files, at other places of another pack
            (again / name).write_bytes(files[name])
    other.push(address)
    assert Store.holds(store, artifact) is False
    assert store.read(artifact, "kbuffer-1.png") == content
    with pytest.raises(FileNotFoundError):
        store.read(artifact, "kbuffer-2.png")
