"""The client and the real API understand each other."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient
from support.api import Api

from diaphane.client import Client
from diaphane_client import Denied, NotFound, Refused, Unavailable, cached, pull
from diaphane_client import server as client_server
from schemas.bundle import load_manifest
from schemas.problem import ExitCode, Problem
from services.registry import handovers
from services.registry.signing import KEY_FILE


@pytest.fixture
def api(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Api:
    found = Api(tmp_path / "service")

    def client(*, headers: dict[str, str], **_: Any) -> httpx.Client:
        return TestClient(found.app, base_url="http://localhost", headers=headers, follow_redirects=False)

    monkeypatch.setattr(client_server.httpx, "Client", client)
    return found


def test_a_published_version_is_pulled_once_and_followed_by_its_alias(
    api: Api, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, logger="httpx")
    options: dict[str, Any] = {"url": "http://localhost", "key": api.secrets["read"], "folder": tmp_path / "bundles"}
    with pytest.raises(NotFound):
        pull("glass", **options)
    for version in ("1.0.0", "1.1.0"):
        api.version(tmp_path / version, version)
    api.service.registry.promote("glass", "1.0.0", "first")
    first = pull("glass", **options)
    assert load_manifest(first).name == "glass"
    caplog.clear()
    assert pull("glass", **options) == first
    assert [record.message.split('"')[1] for record in caplog.records if record.name == "httpx"] == ["HTTP/1.1 200 OK"]
    api.service.registry.promote("glass", "1.1.0", "better")
    assert pull("glass", **options).name == "1.1.0"
    api.service.registry.rollback("glass", "worse")
    assert pull("glass", **options) == first
    assert pull("glass", "1.1.0", **options).name == "1.1.0"
    assert cached("glass", url="http://localhost", folder=tmp_path / "bundles") == first
    with pytest.raises(Denied):
        pull("glass", **{**options, "key": "dia_unknown"})


def test_a_program_reads_the_registry_and_pulls_from_it(api: Api, tmp_path: Path) -> None:
    api.version(tmp_path / "a", "a")
    with Client("http://localhost", api.secrets["read"]) as asked:
        version = asked.models.get("glass", "1.0.0")
        assert [one["version"] for one in asked.models.versions("glass")] == [version["version"]]
        assert "glass" in asked.models.list()._repr_html_()
        folder = asked.models.pull("glass", "1.0.0", tmp_path / "bundles")
        assert (load_manifest(folder).name, folder.name) == ("glass", "1.0.0")
        with pytest.raises(Problem, match="does not have") as caught:
            asked.models.pull("nothing", folder=tmp_path / "bundles")
        assert caught.value.code is ExitCode.NOT_FOUND


@pytest.mark.parametrize("url", ["ftp://x", "http://", "diaphane.example", "https://me:word@diaphane.example"])
def test_what_is_no_url_is_refused_before_anything_is_asked(url: str, tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="server's URL"):
        pull("glass", url=url, key=None, folder=tmp_path)
    with pytest.raises(Problem, match="server's URL"):
        Client(url)


@pytest.mark.parametrize("key", ["two words", "dia_\u00e9", "a\nb"])
def test_what_is_no_key_is_refused_before_anything_is_asked(key: str, tmp_path: Path) -> None:
    with pytest.raises(Denied):
        pull("glass", url="http://localhost", key=key, folder=tmp_path)
    with pytest.raises(Problem) as caught:
        Client("http://localhost", key)
    assert caught.value.code is ExitCode.AUTH
    assert key not in str(caught.value)


def test_a_rotation_of_the_real_service_is_followed(api: Api, tmp_path: Path) -> None:
    options: dict[str, Any] = {"url": "http://localhost", "key": api.secrets["read"], "folder": tmp_path / "bundles"}
    api.version(tmp_path / "a", "a")
    api.version(tmp_path / "b", "b")
    api.service.registry.promote("glass", "1.0.0", "first")
    keys = api.service.registry.public_keys()
    first = pull("glass", public_key=keys[0], **options)
    for _ in range(2):
        keys.insert(0, handovers.rotate(api.service.database, api.service.settings).public_key)
    assert pull("glass", public_key=keys[-1], **options) == first  # the key that a program has in its sources
    api.service.registry.promote("glass", "1.1.0", "better")
    assert pull("glass", **options).name == "1.1.0"
    assert pull("glass", **{**options, "folder": tmp_path / "fresh"}).name == "1.1.0"
    (api.service.settings.state / KEY_FILE).unlink()
    with pytest.raises(Unavailable):  # a server without its key states nothing
        pull("glass", **{**options, "folder": tmp_path / "other"})
    lost = handovers.replace_lost(api.service.database, api.service.settings).public_key
    with pytest.raises(Refused, match="did not hand over"):
        pull("glass", **options)
    assert pull("glass", public_key=lost, **options).name == "1.1.0"
    assert pull("glass", **options).name == "1.1.0"
