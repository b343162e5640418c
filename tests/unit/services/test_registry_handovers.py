"""Another signing key: handed over by the old one, taken by all versions, in one step that can be cut anywhere."""

from __future__ import annotations

import base64
import io
import json
import stat
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from support.bundles import make_bundle

from diaphane.cli.app import run
from schemas.problem import ExitCode, Problem
from services.database import Database, open_database, tables
from services.registry import Registry, handovers, open_registry
from services.registry.signing import KEY_FILE, NEXT_KEY_FILE, Signer, SigningKey, verify
from services.settings import Settings
from services.storage import open_storage

SEED = b"n" * 32


class Site:
    """A registry whose key is in a file, or in the settings."""

    def __init__(self, url: str, state: Path, key: bytes | None = None) -> None:
        given = base64.b64encode(key).decode() if key else ""
        self.settings = Settings(state=state, database=url, signing_key=given)
        self.database: Database = open_database(url)
        blobs = open_storage(self.settings).blobs
        self.registry: Registry = open_registry(self.database, blobs, self.settings)

    def publish(self, folder: Path, weights: str) -> None:
        publication = self.registry.publish("glass", make_bundle(folder / weights, weights), 0.5, {})
        self.registry.promote("glass", publication.version, "it is new")

    def rows(self) -> list[Any]:
        with self.database.read() as connection:
            return list(connection.execute(sa.select(tables.versions).order_by(tables.versions.c.ordinal)))


@pytest.fixture
def site(database_url: str, tmp_path: Path) -> Site:
    found = Site(database_url, tmp_path / "state")
    for weights in "ab":
        found.publish(tmp_path, weights)
    return found


def test_the_old_key_hands_over_and_every_version_is_signed_anew(site: Site, tmp_path: Path) -> None:
    old = site.registry.pointer("glass", "champion").public_key
    before = site.rows()
    done = handovers.rotate(site.database, site.settings)
    assert (done.signed, done.left) == (2, ())
    pointer = site.registry.pointer("glass", "champion")  # by the process that was there before
    assert pointer.public_key == done.public_key != old
    (handover,) = pointer.handovers
    statement = json.loads(handover.statement)
    assert (statement["format"], statement["from"], statement["to"]) == ("diaphane-handover/1", old, done.public_key)
    assert verify(old, handover.statement, handover.signature)
    for row, earlier in zip(site.rows(), before, strict=True):
        assert verify(done.public_key, row.statement, row.signature)
        unsigned = {column for column in row._fields if column not in ("signature", "public_key")}
        assert all(getattr(row, column) == getattr(earlier, column) for column in unsigned)
    path = site.settings.state / KEY_FILE
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert not path.with_name(NEXT_KEY_FILE).exists()
    assert site.registry.public_keys() == [done.public_key, old]
    site.publish(tmp_path, "c")
    assert site.rows()[-1].public_key == done.public_key


def test_handovers_make_a_row_that_ends_where_a_key_was_lost(site: Site) -> None:
    keys = [site.registry.public_keys()[0]]
    keys += [handovers.rotate(site.database, site.settings).public_key for _ in range(2)]
    row = [json.loads(each.statement) for each in site.registry.pointer("glass", "champion").handovers]
    assert [(each["from"], each["to"]) for each in row] == [(keys[0], keys[1]), (keys[1], keys[2])]
    (site.settings.state / KEY_FILE).unlink()
    with pytest.raises(Problem, match="rotate-signing") as caught:
        site.registry.pointer("glass", "champion")
    assert caught.value.code == ExitCode.TRY_AGAIN
    done = handovers.replace_lost(site.database, site.settings)
    assert done.signed == 2
    pointer = site.registry.pointer("glass", "champion")
    assert (pointer.public_key, pointer.handovers) == (done.public_key, ())
    assert site.registry.public_keys() == [done.public_key, *keys[::-1]]


def test_a_rotation_that_was_cut_short_is_finished_by_the_next(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = site.registry.public_keys()[0]

    def cut(*_: Any) -> None:
        raise KeyboardInterrupt

    for broken in ((handovers, "_hand_over"), (Path, "replace")):  # before the database has it, and after
        with monkeypatch.context() as patch:
            patch.setattr(*broken, cut)
            with pytest.raises(KeyboardInterrupt):
                handovers.rotate(site.database, site.settings)
    with pytest.raises(Problem, match="rotate-signing"):
        site.publish(tmp_path, "c")
    with pytest.raises(Problem, match="cut short"):
        handovers.rotate(site.database, site.settings, SEED)
    done = handovers.rotate(site.database, site.settings)
    assert site.registry.public_keys() == [done.public_key, old]
    assert site.registry.pointer("glass", "champion").public_key == done.public_key
    assert {row.public_key for row in site.rows()} == {done.public_key}


def test_a_key_of_the_settings_is_replaced_by_whoever_starts_the_processes(database_url: str, tmp_path: Path) -> None:
    old = Site(database_url, tmp_path / "state", b"o" * 32)
    old.publish(tmp_path, "a")
    with pytest.raises(Problem, match="--new-key"):
        handovers.rotate(old.database, old.settings)
    assert handovers.rotate(old.database, old.settings, SEED).public_key == SigningKey(SEED).public_key
    assert not (tmp_path / "state" / KEY_FILE).exists()
    new = Site(database_url, tmp_path / "state", SEED)
    assert len(new.registry.pointer("glass", "champion").handovers) == 1
    new.publish(tmp_path, "b")
    for attempt in (lambda: old.registry.pointer("glass", "champion"), lambda: old.publish(tmp_path, "c")):
        with pytest.raises(Problem, match="signing key"):  # not started with the new one yet
            attempt()
    with pytest.raises(Problem, match="before"):
        handovers.rotate(new.database, new.settings, b"o" * 32)


def test_what_is_published_while_the_key_changes_has_the_new_one(site: Site, tmp_path: Path) -> None:
    bundles = [make_bundle(tmp_path / f"more-{i}", f"more-{i}") for i in range(12)]

    def publish(bundle: Path) -> None:
        for _ in range(1000):
            try:
                site.registry.publish("glass", bundle, 0.5, {})
                return
            except Problem as problem:
                if problem.code != ExitCode.TRY_AGAIN:  # between the database and the file
                    raise

    with ThreadPoolExecutor(3) as pool:
        published = [pool.submit(publish, bundle) for bundle in bundles]
        for _ in range(3):
            assert handovers.rotate(site.database, site.settings).left == ()
        for each in published:
            each.result()
    key = site.registry.public_keys()[0]
    rows = site.rows()
    assert len(rows) == 14
    assert all(row.public_key == key and verify(key, row.statement, row.signature) for row in rows)


def test_a_version_that_was_changed_in_the_database_is_not_signed_again(site: Site) -> None:
    forged = SigningKey(b"f" * 32)
    for version, values in (
        ("1.0.0", {"statement": site.rows()[1].statement}),
        ("1.1.0", {"public_key": forged.public_key, "signature": forged.sign(site.rows()[1].statement)}),
    ):
        with site.database.write() as connection:
            mine = tables.versions.c.version == version
            connection.execute(tables.versions.update().where(mine).values(**values, created=0.0))
    with site.database.write() as connection:
        connection.execute(
            tables.handovers.insert().values(old_key="", new_key=Signer.open(site.settings).key.public_key, at=0.0)
        )
    before = site.rows()
    assert handovers.rotate(site.database, site.settings).left == ("glass@1.0.0", "glass@1.1.0")
    assert site.rows() == before


def test_the_command_says_the_new_public_key(
    site: Site, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DIAPHANE_DATABASE", site.settings.database)
    at = ["--state", str(tmp_path / "state")]
    new_key = tmp_path / "new.key"
    assert run(["keys", "rotate-signing", "--new-key", str(new_key), *at]) == ExitCode.USAGE
    new_key.write_bytes(base64.b64encode(SEED))
    assert run(["keys", "rotate-signing", "--new-key", str(new_key), "--lost", *at]) == ExitCode.USAGE
    assert run(["keys", "rotate-signing", "--new-key", str(new_key), *at]) == 0
    assert capsys.readouterr().out.split() == [SigningKey(SEED).public_key]
    assert site.registry.public_keys()[0] == SigningKey(SEED).public_key
    assert run(["keys", "rotate-signing", "--json", *at]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "public_key": site.registry.public_keys()[0],
        "signed": 2,
        "left": [],
    }
    monkeypatch.setattr(sys, "stdin", io.StringIO(base64.b64encode(b"i" * 32).decode() + "\n"))
    assert run(["keys", "rotate-signing", "--new-key", "-", *at]) == 0
    assert site.registry.public_keys()[0] == SigningKey(b"i" * 32).public_key
    assert run(["keys", "rotate-signing", "--new-key", "-", *at]) == ExitCode.USAGE
    capsys.readouterr()
    assert run(["keys", "rotate-signing", "--lost", *at]) == 0
    assert "0 versions" in capsys.readouterr().err
