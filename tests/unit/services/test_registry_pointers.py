"""What an alias means, signed and short-lived; its number rises with every move, whatever the clock does."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest
from support.bundles import make_bundle

from schemas.problem import ExitCode, Problem
from services.database import open_database
from services.registry import Registry, open_registry
from services.registry.pointers import LIFETIME_SECONDS
from services.registry.signing import verify
from services.settings import Settings
from services.storage import open_storage


@pytest.fixture
def registry(database_url: str, tmp_path: Path) -> Registry:
    settings = Settings(state=tmp_path / "state", database=database_url)
    found = open_registry(open_database(database_url), open_storage(settings).blobs, settings)
    for weights in "ab":
        found.publish("glass", make_bundle(tmp_path / weights, weights), 0.5, {})
    return found


def said(registry: Registry, selector: str = "champion") -> dict[str, Any]:
    record = registry.pointer("glass", selector)
    assert verify(record.public_key, record.statement, record.signature)
    assert record.handovers == ()
    found: dict[str, Any] = json.loads(record.statement)
    return found


def test_a_pointer_says_what_an_alias_means_and_until_when(registry: Registry) -> None:
    registry.promote("glass", "1.0.0", "first")
    before = int(time.time())
    found = said(registry)
    assert before <= found["issued"] <= time.time()
    assert found["expires"] == found["issued"] + LIFETIME_SECONDS
    wanted = {"format": "diaphane-pointer/1", "name": "glass", "selector": "champion", "version": "1.0.0"}
    assert wanted.items() <= found.items()
    assert found["digest"] == registry.resolve("glass@1.0.0").digest
    assert set(found) == {*wanted, "digest", "serial", "issued", "expires"}


def test_the_serial_rises_with_every_move_of_the_alias_and_with_nothing_else(
    registry: Registry, monkeypatch: pytest.MonkeyPatch
) -> None:
    registry.promote("glass", "1.0.0", "first")
    serials = [said(registry)["serial"]]
    registry.promote("glass", "1.1.0", "a trial", alias="trial")
    registry.promote("glass", "1.0.0", "the same")
    assert said(registry)["serial"] == serials[0]
    for now in (time.time() + 1e6, 1.0, 0.0):  # the clock goes back
        monkeypatch.setattr(time, "time", lambda now=now: now)
        registry.promote("glass", "1.1.0", "forth")
        serials.append(said(registry)["serial"])
        registry.rollback("glass", "back")
        serials.append(said(registry)["serial"])
        assert said(registry)["version"] == "1.0.0"
    assert all(isinstance(serial, int) for serial in serials)
    assert serials == sorted(set(serials))


def test_a_version_points_at_itself(registry: Registry) -> None:
    found = said(registry, "1.1.0")
    assert (found["selector"], found["version"], found["serial"]) == ("1.1.0", "1.1.0", 0)


@pytest.mark.parametrize(("name", "selector"), [("glass", "champion"), ("glass", "9.9.9"), ("none", "champion")])
def test_there_is_no_pointer_to_what_is_not_there(name: str, selector: str, registry: Registry) -> None:
    with pytest.raises(Problem) as caught:
        registry.pointer(name, selector)
    assert caught.value.code == ExitCode.NOT_FOUND
