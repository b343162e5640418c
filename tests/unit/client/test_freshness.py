"""Whoever answers in the server's place, with all that it ever signed, cannot make a client go back, or stay for ever.

Every test of an attack has a server in the attacker's hands: it answers with what the genuine one signed before, or for
others, or with keys of its own.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.release_server import KEY, ReleaseServer
from support.releases import SIGNER, STRANGER, Record, handover, pointer_to, publish, serve, state

from diaphane_client import Refused, Unavailable, cached, forget, pull, pulling
from diaphane_client import server as client_server
from diaphane_client.trust import SKEW_SECONDS
from services.registry.pointers import LIFETIME_SECONDS
from services.registry.signing import SigningKey

SECOND, THIRD = SigningKey(b"2" * 32), SigningKey(b"3" * 32)
Y2001 = 1_000_000_000.0


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[ReleaseServer]:
    monkeypatch.setattr(client_server, "FIRST_WAIT", 0.001)
    found = ReleaseServer()
    yield found
    found.stop()


@pytest.fixture
def old(server: ReleaseServer, tmp_path: Path) -> Record:
    """A version that was the champion before the one that is."""
    record = publish(server, tmp_path, "1.0.0")
    publish(server, tmp_path, "1.2.0")
    return record


def fetch(server: ReleaseServer, tmp_path: Path, alias: str = "champion", **options: Any) -> str:
    options = {"url": server.url, "key": KEY, "folder": tmp_path / "bundles", **options}
    return pull("glass", alias, **options).name


def at(monkeypatch: pytest.MonkeyPatch, moment: float) -> None:
    """Sets the client's clock."""
    monkeypatch.setattr(pulling, "time", SimpleNamespace(time=lambda: moment))


def visible(tmp_path: Path) -> list[str]:
    return sorted(path.name for path in (tmp_path / "bundles" / "glass" / "versions").glob("*"))


# A client that has seen nothing yet


@pytest.mark.parametrize("age", [LIFETIME_SECONDS + SKEW_SECONDS + 2.0, time.time() - Y2001])
def test_a_fresh_client_takes_no_expired_statement(
    age: float, server: ReleaseServer, old: Record, tmp_path: Path
) -> None:
    state(server, pointer_to(old, issued=time.time() - age))
    with pytest.raises(Refused, match=r"expired at .* Set the clock"):
        fetch(server, tmp_path)
    assert visible(tmp_path) == []


def test_a_fresh_client_takes_no_statement_without_end_or_of_the_future(
    server: ReleaseServer, old: Record, tmp_path: Path
) -> None:
    for wrong, why in (
        (pointer_to(old, issued=Y2001, lifetime=2_000_000_000), "too long"),
        (pointer_to(old, expires=0), "too long"),
        (pointer_to(old, issued=time.time() + SKEW_SECONDS + 100.0), "yet to come"),
    ):
        state(server, wrong)
        with pytest.raises(Refused, match=why):
            fetch(server, tmp_path)
    assert visible(tmp_path) == []


def test_a_version_that_was_signed_and_never_promoted_is_not_taken(
    server: ReleaseServer, old: Record, tmp_path: Path
) -> None:
    champion = server.records["glass/versions/1.2.0"]
    trial = publish(server, tmp_path, "1.3.0", alias="trial")
    server.records["glass/versions/1.2.0"] = json.dumps(trial).encode()
    with pytest.raises(Refused, match=r"sent 'glass' 1\.3\.0"):
        fetch(server, tmp_path)
    server.records["glass/versions/1.2.0"] = champion
    for about, selector in (("trial", "trial"), ("1.3.0", "1.3.0")):
        server.records["glass/pointers/champion"] = server.records[f"glass/pointers/{about}"]
        with pytest.raises(Refused, match=f"about 'glass' {selector}, not about 'glass' champion"):
            fetch(server, tmp_path)
    state(server, pointer_to({**trial, "name": "crystal"}))
    with pytest.raises(Refused, match="about 'crystal' champion"):
        fetch(server, tmp_path)
    assert visible(tmp_path) == []


def test_clocks_may_differ_a_little(
    server: ReleaseServer, old: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.time()
    for skew in (-SKEW_SECONDS + 60.0, LIFETIME_SECONDS + SKEW_SECONDS - 60.0):
        at(monkeypatch, now + skew)
        assert fetch(server, tmp_path, folder=tmp_path / str(skew)) == "1.2.0"


# One that has seen something


def test_an_answer_that_stays_the_same_for_ever_expires(
    server: ReleaseServer, old: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.time()
    assert fetch(server, tmp_path) == "1.2.0"
    at(monkeypatch, now + LIFETIME_SECONDS)
    assert fetch(server, tmp_path) == "1.2.0"
    at(monkeypatch, now + LIFETIME_SECONDS + SKEW_SECONDS + 2.0)
    with pytest.raises(Refused, match="old answers"):
        fetch(server, tmp_path)
    server.status = 304
    with pytest.raises(Refused, match="status 304"):
        fetch(server, tmp_path)


def test_what_was_signed_before_a_move_is_not_taken_after_it(
    server: ReleaseServer, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = publish(server, tmp_path, "1.0.0")
    before = pointer_to(first)
    assert fetch(server, tmp_path) == "1.0.0"
    second = publish(server, tmp_path, "1.1.0")
    between = pointer_to(second)
    assert fetch(server, tmp_path) == "1.1.0"
    state(server, before)
    with pytest.raises(Refused, match=r"older than one that was seen here: 1\.0\.0, where it was 1\.1\.0 later"):
        fetch(server, tmp_path)
    state(server, between)
    assert fetch(server, tmp_path) == "1.1.0"
    serve(server, first)  # a rollback is a move like any other
    assert fetch(server, tmp_path) == "1.0.0"
    for replayed in (before, between):
        state(server, replayed)
        with pytest.raises(Refused, match="older than one that was seen"):
            fetch(server, tmp_path)
    serve(server, second)
    assert fetch(server, tmp_path) == "1.1.0"


def test_one_move_means_one_version(server: ReleaseServer, old: Record, tmp_path: Path) -> None:
    state(server, pointer_to(old, serial=10**9))
    assert fetch(server, tmp_path) == "1.0.0"
    state(server, pointer_to(json.loads(server.records["glass/versions/1.2.0"]), serial=10**9))
    with pytest.raises(Refused, match="at once"):
        fetch(server, tmp_path)


def test_a_clock_that_was_set_back_makes_no_old_statement_new(
    server: ReleaseServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = time.time()
    ancient = pointer_to(publish(server, tmp_path, "1.0.0", alias="trial"), "trial", issued=now - 1e6)
    publish(server, tmp_path, "1.1.0")
    assert fetch(server, tmp_path) == "1.1.0"
    at(monkeypatch, now - 1e6)
    state(server, ancient, "trial")
    with pytest.raises(Refused, match=r"expired at .* was seen here\. Set the clock"):
        fetch(server, tmp_path, "trial")


def test_every_alias_moves_by_itself(server: ReleaseServer, tmp_path: Path) -> None:
    publish(server, tmp_path, "1.5.0", alias="trial", serial=1_000_000)
    assert fetch(server, tmp_path, "trial") == "1.5.0"
    first = publish(server, tmp_path, "1.4.0", serial=7)
    assert fetch(server, tmp_path) == "1.4.0"
    assert fetch(server, tmp_path, "1.5.0") == "1.5.0"
    serve(server, first, "trial", serial=1_000_001)
    assert fetch(server, tmp_path, "trial") == "1.4.0"
    state(server, pointer_to(first, serial=6))
    with pytest.raises(Refused, match="older"):
        fetch(server, tmp_path)


# Keys


@pytest.mark.parametrize("given", [None, SECOND.public_key])
def test_a_new_key_makes_nothing_older_new(
    given: str | None, server: ReleaseServer, old: Record, tmp_path: Path
) -> None:
    assert fetch(server, tmp_path) == "1.2.0"
    publish(server, tmp_path, "0.9.0", signer=SECOND)
    with pytest.raises(Refused, match="did not hand over" if given is None else r"go back from 1\.2\.0 to 0\.9\.0"):
        fetch(server, tmp_path, public_key=given)
    for serial in (0, 1):
        publish(server, tmp_path, "1.3.0", signer=SECOND, serial=serial)
        with pytest.raises(Refused):
            fetch(server, tmp_path, public_key=given)
    assert visible(tmp_path) == ["1.2.0"]


def test_a_key_that_was_handed_over_is_followed_and_the_old_one_is_not(
    server: ReleaseServer, old: Record, tmp_path: Path
) -> None:
    assert fetch(server, tmp_path) == "1.2.0"
    row = [handover(SIGNER, SECOND), handover(SECOND, THIRD)]
    publish(server, tmp_path, "1.3.0", signer=THIRD, handovers=row)
    assert fetch(server, tmp_path) == "1.3.0"
    assert fetch(server, tmp_path, public_key=SIGNER.public_key) == "1.3.0"  # given once, for ever in a program
    newer = publish(server, tmp_path, "1.4.0")
    for stolen, given in ((SIGNER, None), (SIGNER, SIGNER.public_key), (SECOND, None)):
        serve(server, newer, signer=stolen, handovers=[handover(SIGNER, SECOND)] if stolen is SECOND else [])
        with pytest.raises(Refused, match="handed over to another one"):
            fetch(server, tmp_path, public_key=given)
    for given in (None, SIGNER.public_key):  # the thief names a successor of its own
        publish(server, tmp_path, "1.5.0", signer=STRANGER, handovers=[handover(SIGNER, STRANGER)])
        with pytest.raises(Refused, match="did not hand over"):
            fetch(server, tmp_path, public_key=given)
    assert visible(tmp_path) == ["1.2.0", "1.3.0"]


def test_a_row_of_handovers_with_a_gap_or_by_others_leads_nowhere(
    server: ReleaseServer, old: Record, tmp_path: Path
) -> None:
    assert fetch(server, tmp_path) == "1.2.0"
    good = [handover(SIGNER, SECOND), handover(SECOND, THIRD)]
    forged = {**handover(STRANGER, SECOND), "statement": good[0]["statement"]}
    for row in (good[:1], good[1:], good[::-1], [forged, good[1]], [*good, good[0]], good * 40, [{}], None):
        server.records["glass/pointers/champion"] = json.dumps(
            {**pointer_to(old, signer=THIRD), "handovers": row}
        ).encode()
        with pytest.raises(Refused):
            fetch(server, tmp_path)


def test_numbers_go_on_over_a_handover(server: ReleaseServer, old: Record, tmp_path: Path) -> None:
    assert fetch(server, tmp_path) == "1.2.0"
    row = [handover(SIGNER, SECOND)]
    serve(server, old, signer=SECOND, handovers=row, serial=0)
    with pytest.raises(Refused, match="older than one that was seen"):
        fetch(server, tmp_path)


def test_a_name_can_be_begun_anew_on_purpose(server: ReleaseServer, old: Record, tmp_path: Path) -> None:
    assert fetch(server, tmp_path) == "1.2.0"
    publish(server, tmp_path, "0.9.0", signer=SECOND, serial=1)
    forget("glass", folder=tmp_path / "bundles")
    with pytest.raises(Refused, match="did not hand over"):  # the server's key is another matter
        fetch(server, tmp_path)
    assert fetch(server, tmp_path, public_key=SECOND.public_key) == "0.9.0"
    assert fetch(server, tmp_path) == "0.9.0"


# The folder


def test_no_file_of_the_folder_can_be_lost_so_that_an_older_version_is_taken(
    server: ReleaseServer, tmp_path: Path
) -> None:
    before = pointer_to(publish(server, tmp_path, "1.0.0"))
    publish(server, tmp_path, "1.1.0")
    assert fetch(server, tmp_path) == "1.1.0"
    kept = tmp_path / "kept"
    shutil.copytree(tmp_path / "bundles", kept)
    state(server, before)
    lost = [path.relative_to(kept) for path in kept.rglob("*")]
    assert len(lost) > 10
    for path in lost:
        for damage in ("gone", "empty"):
            shutil.rmtree(tmp_path / "bundles")
            shutil.copytree(kept, tmp_path / "bundles")
            target = tmp_path / "bundles" / path
            if target.is_dir():
                shutil.rmtree(target)
            elif damage == "gone":
                target.unlink()
            else:
                target.write_bytes(b"")
            with pytest.raises(Refused):
                fetch(server, tmp_path)
            assert not (tmp_path / "bundles" / "glass" / "versions" / "1.0.0").exists()


@pytest.mark.parametrize("content", [None, b"", b"{", b"[]", b"{}", b'{"format": "diaphane-trust/1"}', b"\xff"])
def test_lost_trust_is_not_taken_for_a_first_visit(
    content: bytes | None, server: ReleaseServer, tmp_path: Path
) -> None:
    publish(server, tmp_path, "1.0.0")
    fetch(server, tmp_path)
    trust = tmp_path / "bundles" / "trust.json"
    if content is None:
        trust.unlink()
    else:
        trust.write_bytes(content)
    for attempt in (
        lambda: fetch(server, tmp_path),
        lambda: cached("glass", url=server.url, folder=tmp_path / "bundles"),
    ):
        with pytest.raises(Refused, match="Restore that file"):
            attempt()
    if content is None:
        forget("glass", folder=tmp_path / "bundles")
        assert fetch(server, tmp_path) == "1.0.0"
    else:
        with pytest.raises(Refused, match="empty folder"):
            forget("glass", folder=tmp_path / "bundles")


def test_a_server_with_another_key_needs_a_folder_of_its_own_and_one_that_moved_does_not(
    server: ReleaseServer, old: Record, tmp_path: Path
) -> None:
    assert fetch(server, tmp_path) == "1.2.0"
    other = ReleaseServer()
    try:
        publish(other, tmp_path, "1.3.0", signer=STRANGER)
        with pytest.raises(Refused, match="a folder of its own"):
            fetch(other, tmp_path)
        assert fetch(other, tmp_path, folder=tmp_path / "others") == "1.3.0"
        serve(other, old, serial=0)
        with pytest.raises(Refused, match="older than one that was seen"):
            fetch(other, tmp_path)
        other.records |= server.records
        assert fetch(other, tmp_path) == "1.2.0"
    finally:
        other.stop()


def test_a_server_that_is_away_is_said_with_the_time_of_its_last_word(
    server: ReleaseServer, old: Record, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    fetch(server, tmp_path)
    server.stop()
    assert fetch(server, tmp_path) == "1.2.0"
    assert f"confirmed at {time.strftime('%Y-%m-%d', time.gmtime())}" in caplog.text
    with pytest.raises(Unavailable):
        fetch(server, tmp_path, "trial")


def test_a_download_that_was_cut_counts_as_seen(server: ReleaseServer, tmp_path: Path) -> None:
    before = pointer_to(publish(server, tmp_path, "1.0.0"))
    assert fetch(server, tmp_path) == "1.0.0"
    publish(server, tmp_path, "1.1.0")
    server.cuts = [0] * client_server.ATTEMPTS
    assert fetch(server, tmp_path) == "1.0.0"  # as long as the other one is not here
    state(server, before)
    with pytest.raises(Refused, match="older"):
        fetch(server, tmp_path)


def test_questions_that_bring_nothing_new_write_nothing(
    server: ReleaseServer, old: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    champion = json.loads(server.records["glass/versions/1.2.0"])
    trust = tmp_path / "bundles" / "trust.json"
    now = time.time()
    state(server, pointer_to(champion, serial=10**9, issued=now))
    fetch(server, tmp_path)
    written = trust.stat().st_ino
    for later, is_written in ((1.0, False), (SKEW_SECONDS - 1.0, False), (SKEW_SECONDS + 1.0, True)):
        at(monkeypatch, now + later)
        state(server, pointer_to(champion, serial=10**9, issued=now + later))
        fetch(server, tmp_path)
        assert (trust.stat().st_ino != written) == is_written
