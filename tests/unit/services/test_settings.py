from __future__ import annotations

from pathlib import Path

import pytest

from schemas.problem import ExitCode, Problem
from services.settings import Settings


def test_without_any_variable_everything_lies_in_the_state_folder(tmp_path: Path) -> None:
    settings = Settings(state=tmp_path)
    assert settings.database_url == f"sqlite:///{tmp_path / 'diaphane.sqlite'}"
    assert settings.store_url == str(tmp_path / "store")


@pytest.mark.parametrize(("name", "value"), [("RATE", "abc"), ("TTL", "0.1"), ("SLOTS_RENDER", "0")])
def test_a_variable_that_cannot_be_used_is_named(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(f"DIAPHANE_{name}", value)
    with pytest.raises(Problem, match=f"DIAPHANE_{name}") as caught:
        Settings()
    assert caught.value.code == ExitCode.USAGE


def test_secrets_are_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DIAPHANE_DATABASE", "postgresql://u:hidden-word@h/d")
    monkeypatch.setenv("DIAPHANE_SIGNING_KEY", "hidden-word")
    assert "hidden-word" not in repr(Settings())


def test_proxies_are_addresses_and_networks(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Settings().trusted_proxies == ()
    monkeypatch.setenv("DIAPHANE_PROXIES", "10.0.0.0/8, ::1")
    assert Settings().trusted_proxies == ("10.0.0.0/8", "::1")
    for wrong in ("*", "proxy.example", "10.0.0.1/8"):
        monkeypatch.setenv("DIAPHANE_PROXIES", wrong)
        with pytest.raises(Problem, match="DIAPHANE_PROXIES cannot be used"):
            Settings()
