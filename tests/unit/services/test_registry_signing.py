"""The signing key: made once, readable by its owner only, the same in every process."""

from __future__ import annotations

import base64
import os
import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from schemas.problem import Problem
from services.registry import Signer
from services.registry.signing import KEY_FILE, verify
from services.settings import Settings


def test_the_key_is_made_once_and_only_its_owner_may_read_it(tmp_path: Path) -> None:
    settings = Settings(state=tmp_path / "state")
    with ThreadPoolExecutor(8) as pool:
        keys = set(pool.map(lambda _: Signer.open(settings).key.public_key, range(8)))
    assert len(keys) == 1
    path = tmp_path / "state" / KEY_FILE
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert [entry.name for entry in path.parent.iterdir()] == [KEY_FILE]


def test_opening_a_signer_writes_nothing(tmp_path: Path) -> None:
    Signer.open(Settings(state=tmp_path / "state"))
    assert not (tmp_path / "state").exists()


def test_the_key_of_the_settings_is_used(tmp_path: Path) -> None:
    seed = base64.b64encode(os.urandom(32)).decode()
    key = Signer.open(Settings(state=tmp_path, signing_key=seed)).key
    assert key.public_key == Signer.open(Settings(state=tmp_path / "other", signing_key=seed)).key.public_key
    assert verify(key.public_key, "text", key.sign("text"))
    assert not verify(Signer.open(Settings(state=tmp_path)).key.public_key, "text", key.sign("text"))


@pytest.mark.parametrize("key", ["x", "AAAA", base64.b64encode(bytes(31)).decode()])
def test_a_key_that_is_none_is_refused_and_not_shown(key: str, tmp_path: Path) -> None:
    with pytest.raises(Problem, match="openssl rand -base64 32") as caught:
        Signer.open(Settings(state=tmp_path, signing_key=key))
    assert len(key) == 1 or key not in str(caught.value)


def test_a_damaged_key_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / KEY_FILE).write_bytes(b"\xff\x00")
    with pytest.raises(Problem, match=KEY_FILE):
        _ = Signer.open(Settings(state=tmp_path)).key
