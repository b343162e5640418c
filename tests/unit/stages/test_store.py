"""The store: complete or absent, first writer wins, damage is noticed."""

from __future__ import annotations

import json
import logging
import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from multiprocessing.synchronize import Event
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schemas.canonical import canonical_json, file_sha256
from stages.store import META, STALE_SECONDS, Address, Store, write_durably

ADDRESS = Address("label", "v1", ("a", "b"), {"g": 0.75, "tail": "density"})


def put_text(store: Store, address: Address, text: str) -> None:
    with store.put(address) as folder:
        (folder / "sub").mkdir()
        (folder / "sub" / "data.txt").write_text(text)


def test_an_artifact_is_found_again_by_what_it_was_made_from(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert not store.has(ADDRESS)
    assert store.get(ADDRESS) is None
    put_text(store, ADDRESS, "labels")
    folder = Store(tmp_path).get(ADDRESS)
    assert folder == tmp_path / "label" / ADDRESS.key[:2] / ADDRESS.key
    assert (folder / "sub" / "data.txt").read_text() == "labels"


@pytest.mark.parametrize(
    "other",
    [
        Address("render", "v1", ("a", "b"), {"g": 0.75, "tail": "density"}),
        Address("label", "v2", ("a", "b"), {"g": 0.75, "tail": "density"}),
        Address("label", "v1", ("b", "a"), {"g": 0.75, "tail": "density"}),
        Address("label", "v1", ("a", "b"), {"g": 0.5, "tail": "density"}),
        Address("label", "v1", ("a", "b"), {"g": 0.75}),
    ],
)
def test_every_ingredient_is_part_of_the_key(other: Address) -> None:
    assert other.key != ADDRESS.key


def test_the_key_does_not_depend_on_the_order_of_parameters() -> None:
    assert Address("label", "v1", ["a", "b"], {"tail": "density", "g": 0.75}).key == ADDRESS.key


def test_the_key_is_the_same_in_every_release() -> None:
    # A changed key would throw away every artifact that users have: change it knowingly.
    assert ADDRESS.key == "3ffd48903694bc7ade1c203a4243f6f71687a07e8124f9c8a750c16e1b80ff72"


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
)


@given(_JSON)
def test_canonical_json_reads_back_as_what_was_written(value: object) -> None:
    text = canonical_json(value)
    assert json.loads(text) == value
    assert canonical_json(json.loads(text)) == text


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_parameters_that_json_has_no_number_for_are_refused(value: float) -> None:
    with pytest.raises(ValueError, match="JSON compliant"):
        _ = Address("label", "v1", (), {"g": value}).key


def test_meta_says_what_the_artifact_is(tmp_path: Path) -> None:
    store = Store(tmp_path)
    put_text(store, ADDRESS, "labels")
    meta = json.loads((store.path(ADDRESS) / META).read_text())
    assert meta["stage"] == "label"
    assert meta["inputs"] == ["a", "b"]
    assert meta["params"] == {"g": 0.75, "tail": "density"}
    assert meta["files"]["sub/data.txt"]["bytes"] == 6


def test_a_body_that_raises_leaves_nothing(tmp_path: Path) -> None:
    store = Store(tmp_path)
    with pytest.raises(IsADirectoryError), store.put(ADDRESS) as folder:
        folder.write_text("a folder cannot be written like a file")
    assert not store.has(ADDRESS)
    assert list((tmp_path / "tmp").iterdir()) == []


def test_the_loser_of_a_race_discards_its_copy(tmp_path: Path) -> None:
    first, second = Store(tmp_path), Store(tmp_path)
    with second.put(ADDRESS) as folder:
        (folder / "data").write_text("late")
        put_text(first, ADDRESS, "early")
    found = second.get(ADDRESS)
    assert found is not None
    assert (found / "sub" / "data.txt").read_text() == "early"
    assert list((tmp_path / "tmp").iterdir()) == []


def _damage_content(folder: Path) -> None:
    (folder / "sub" / "data.txt").write_text("labelz")


def _damage_length(folder: Path) -> None:
    (folder / "sub" / "data.txt").write_text("label")


def _remove_file(folder: Path) -> None:
    (folder / "sub" / "data.txt").unlink()


def _damage_meta(folder: Path) -> None:
    (folder / META).write_text("{")


def _foreign_meta(folder: Path) -> None:
    meta = json.loads((folder / META).read_text())
    (folder / META).write_text(json.dumps({**meta, "version": "v0"}))


def _meta_of_wrong_type(folder: Path) -> None:
    (folder / META).write_text("[]")


@pytest.mark.parametrize(
    "damage", [_damage_content, _damage_length, _remove_file, _damage_meta, _foreign_meta, _meta_of_wrong_type]
)
def test_a_damaged_artifact_is_moved_aside_and_counts_as_missing(
    damage: Callable[[Path], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    put_text(Store(tmp_path), ADDRESS, "labels")
    damage(Store(tmp_path).path(ADDRESS))
    store = Store(tmp_path)
    with caplog.at_level(logging.WARNING):
        assert store.get(ADDRESS) is None
    assert "is damaged" in caplog.text
    assert not store.has(ADDRESS)
    assert len(list((tmp_path / "damaged").iterdir())) == 1
    put_text(store, ADDRESS, "labels")
    assert Store(tmp_path).get(ADDRESS) is not None


def test_touched_files_are_hashed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put_text(Store(tmp_path), ADDRESS, "labels")
    (Store(tmp_path).path(ADDRESS) / "data.txt").touch()
    hashed: list[Path] = []

    def spy(path: Path) -> str:
        hashed.append(path)
        return file_sha256(path)

    monkeypatch.setattr("stages.store.file_sha256", spy)
    store = Store(tmp_path)
    assert store.get(ADDRESS) is not None
    assert store.get(ADDRESS) is not None
    assert Store(tmp_path).get(ADDRESS) is not None
    assert [path.name for path in hashed] == ["data.txt"]


def test_what_a_crash_left_is_removed_when_it_is_old(tmp_path: Path) -> None:
    Store(tmp_path)
    old, young = tmp_path / "tmp" / "label-old", tmp_path / "tmp" / "label-young"
    for folder in (old, young):
        folder.mkdir()
        (folder / "half").write_text("x")
    past = time.time() - STALE_SECONDS - 60
    for path in (old / "half", old):
        os.utime(path, (past, past))
    Store(tmp_path)
    assert not old.exists()
    assert young.exists()


def _write_until_killed(root: Path, ready: Event) -> None:
    with Store(root).put(ADDRESS) as folder:
        (folder / "data").write_text("half")
        ready.set()
        time.sleep(60)


def test_a_killed_writer_leaves_no_artifact(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    writer = context.Process(target=_write_until_killed, args=(tmp_path, ready))
    writer.start()
    assert ready.wait(20)
    assert writer.pid is not None
    os.kill(writer.pid, signal.SIGKILL)
    writer.join()
    store = Store(tmp_path)
    assert not store.has(ADDRESS)
    put_text(store, ADDRESS, "labels")
    assert store.get(ADDRESS) is not None


def test_write_durably_replaces_and_leaves_no_temporary_file(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    write_durably(path, "one")
    write_durably(path, "two")
    assert path.read_text() == "two"
    assert list(tmp_path.iterdir()) == [path]


def test_what_matched_before_and_has_not_changed_is_not_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = Address("render", "1", ("input",), {})
    with Store(tmp_path).put(address) as folder:
        (folder / "dump").write_bytes(b"fragments")
    with monkeypatch.context() as patch:
        patch.setattr("stages.store.file_sha256", lambda _: pytest.fail("it was read again"))
        assert Store(tmp_path).get(address) is not None
    (Store(tmp_path).path(address) / "dump").write_bytes(b"fragmentz")
    assert Store(tmp_path).get(address) is None
