"""Artifacts in a folder and in an object store: fetched whole, verified, made again when damaged."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from services.settings import Settings
from services.storage import Storage, open_storage
from services.storage.remote import Remote
from services.storage.tiered import ORPHAN_SECONDS, TieredStore
from stages.store import META, Address, MissingArtifact, Store

ADDRESS = Address("label", "v1", ("a", "b"), {"g": 0.75, "tail": "density"})
ARTIFACT = ADDRESS.artifact
FILES = {"facts.json": b"{}", "sub/0.0": b"first chunk", "sub/0.1": b"", "sub/deep/1": os.urandom(70_000)}

Machine = Callable[[str], Storage]


def remote_machine(tmp_path: Path, s3_url: str, name: str) -> TieredStore:
    store = open_storage(Settings(state=tmp_path / name, store=s3_url)).store
    assert isinstance(store, TieredStore)
    return store


def make(store: Store, address: Address = ADDRESS, files: dict[str, bytes] = FILES) -> None:
    with store.put(address) as folder:
        for name, content in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)


def content(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != META)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def test_what_one_machine_pushed_another_fetches(machine: Machine) -> None:
    one, two = machine("one").store, machine("two").store
    assert not two.holds(ARTIFACT)
    with pytest.raises(MissingArtifact) as caught:
        two.fetch(ARTIFACT)
    assert caught.value.artifact == ARTIFACT
    make(one)
    one.push(ADDRESS)
    assert two.holds(ARTIFACT)
    assert content(two.fetch(ARTIFACT)) == FILES
    assert two.get(ADDRESS) == two.fetch(ARTIFACT)


def test_a_single_file_is_read_and_verified(machine: Machine) -> None:
    one, two = machine("one").store, machine("two").store
    with pytest.raises(MissingArtifact):
        two.read(ARTIFACT, "facts.json")
    make(one)
    one.push(ADDRESS)
    for name, expected in FILES.items():
        assert two.read(ARTIFACT, name) == expected
    with pytest.raises(FileNotFoundError):
        two.read(ARTIFACT, "other.json")


def test_what_an_artifact_was_made_from_is_known_without_fetching_it(machine: Machine) -> None:
    one, two = machine("one").store, machine("two").store
    with pytest.raises(MissingArtifact):
        two.made_from(ARTIFACT)
    make(one)
    one.push(ADDRESS)
    found = two.made_from(ARTIFACT)
    assert (found.artifact, list(found.inputs), found.params) == (ARTIFACT, ["a", "b"], ADDRESS.params)
    (one.path(ADDRESS) / META).write_text("{}")
    if isinstance(one, TieredStore):
        assert one.made_from(ARTIFACT).key == ADDRESS.key
    else:
        with pytest.raises(MissingArtifact):
            one.made_from(ARTIFACT)


def test_a_removed_artifact_is_gone_for_all(machine: Machine) -> None:
    one, two = machine("one").store, machine("two").store
    make(one)
    one.push(ADDRESS)
    one.remove(ARTIFACT)
    one.remove(ARTIFACT)
    assert not one.holds(ARTIFACT)
    assert not two.holds(ARTIFACT)
    assert list(two.artifacts()) == []


def test_artifacts_are_listed_with_size_and_use(machine: Machine) -> None:
    store = machine("one").store
    make(store)
    store.push(ADDRESS)
    (found,) = store.artifacts()
    assert found.artifact == ARTIFACT
    assert 0 < found.bytes - sum(map(len, FILES.values())) < 3000
    assert abs(found.last_used - store.path(ADDRESS).stat().st_mtime) < 5


def test_a_use_is_written_down_and_does_not_look_like_a_change(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = machine("one").store
    make(store)
    store.push(ADDRESS)
    past = store.path(ADDRESS).stat().st_mtime - 1_000_000
    os.utime(store.path(ADDRESS), (past, past))
    monkeypatch.setattr("services.storage.remote.USED_SECONDS", -1)
    monkeypatch.setattr("stages.store.file_sha256", lambda _: pytest.fail("it was read again"))
    store.fetch(ARTIFACT)
    (found,) = store.artifacts()
    assert found.last_used > past + 900_000


@pytest.mark.parametrize("artifact", ["label", "label/abc", "../label/" + "0" * 64, "label/" + "g" * 64])
def test_other_names_are_no_artifacts(artifact: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="does not name an artifact"):
        Store(tmp_path).fetch(artifact)


def test_a_damaged_file_that_is_read_alone_makes_the_artifact_missing(tmp_path: Path) -> None:
    store = Store(tmp_path)
    make(store)
    (store.path(ADDRESS) / "facts.json").write_bytes(b"[]")
    with pytest.raises(MissingArtifact):
        store.read(ARTIFACT, "facts.json")
    assert not store.holds(ARTIFACT)


def test_damage_after_the_first_verification_is_noticed_by_the_same_process(tmp_path: Path) -> None:
    store = Store(tmp_path)
    make(store)
    store.fetch(ARTIFACT)
    with (store.path(ADDRESS) / "sub" / "0.0").open("ab") as stream:
        stream.write(b"torn")
    with pytest.raises(MissingArtifact):
        store.fetch(ARTIFACT)


def test_a_full_disk_is_an_os_error_and_leaves_nothing(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    store = machine("one").store

    def full(folder: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("stages.store.sync_tree", full)
        with pytest.raises(OSError, match="No space left"):
            make(store)
    assert not store.holds(ARTIFACT)
    assert list((store.root / "tmp").iterdir()) == []
    make(store)
    store.push(ADDRESS)
    assert store.holds(ARTIFACT)


def test_a_full_cache_is_an_os_error_and_is_not_taken_for_damage(
    tmp_path: Path, s3_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, two = (remote_machine(tmp_path, s3_url, name) for name in ("one", "two"))
    make(one)
    one.push(ADDRESS)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "mkdir", _full)
        with pytest.raises(OSError, match="No space left"):
            two.fetch(ARTIFACT)
    assert content(two.fetch(ARTIFACT)) == FILES


def _full(*_args: Any, **_options: Any) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")


def objects(s3_url: str) -> dict[str, int]:
    return {entry.key: entry.bytes for entry in Remote.open(s3_url).list("artifacts")}


def _truncate_pack(remote: Remote, pack: str, meta: str) -> None:
    remote.put(pack, b"".join(remote.range(pack, 0, 5000)))


def _change_pack(remote: Remote, pack: str, meta: str) -> None:
    entry = remote.head(pack)
    assert entry is not None
    whole = bytearray(b"".join(remote.range(pack, 0, entry.bytes)))
    for i in range(len(whole)):
        whole[i] ^= 1
    remote.put(pack, bytes(whole))


def _remove_pack(remote: Remote, pack: str, meta: str) -> None:
    remote.delete([pack])


def _tear_meta(remote: Remote, pack: str, meta: str) -> None:
    found = remote.get(meta)
    assert found is not None
    remote.put(meta, found[0][: len(found[0]) // 2])


def _lead_astray(remote: Remote, pack: str, meta: str) -> None:
    found = remote.get(meta)
    assert found is not None
    record = json.loads(found[0])
    record["files"] = {f"../../{name}": file for name, file in record["files"].items()}
    remote.put(meta, json.dumps(record).encode())


@pytest.mark.parametrize("damage", [_truncate_pack, _change_pack, _remove_pack, _tear_meta, _lead_astray])
@pytest.mark.parametrize("read", ["fetch", "read"])
def test_what_is_damaged_in_the_object_store_is_removed_and_can_be_made_again(
    damage: Callable[[Remote, str, str], None], read: str, tmp_path: Path, s3_url: str
) -> None:
    one, two = (remote_machine(tmp_path, s3_url, name) for name in ("one", "two"))
    make(one)
    one.push(ADDRESS)
    meta, pack = sorted(objects(s3_url))
    damage(Remote.open(s3_url), pack, meta)
    with pytest.raises((MissingArtifact, FileNotFoundError)):
        two.fetch(ARTIFACT) if read == "fetch" else two.read(ARTIFACT, "sub/deep/1")
    if (damage, read) == (_lead_astray, "read"):
        return  # the file is not listed there, which only a whole fetch takes for damage
    assert objects(s3_url) == {}
    assert not two.holds(ARTIFACT)
    make(two)
    two.push(ADDRESS)
    assert content(remote_machine(tmp_path, s3_url, "three").fetch(ARTIFACT)) == FILES


def test_of_two_writers_the_first_one_stays_and_the_second_leaves_nothing(tmp_path: Path, s3_url: str) -> None:
    machines = [remote_machine(tmp_path, s3_url, f"m{i}") for i in range(4)]
    for i, store in enumerate(machines):
        make(store, files={"facts.json": b"%d" % i})
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda store: store._send(ARTIFACT), machines))  # none sees that another one has sent it
    assert len(objects(s3_url)) == 2
    winner = remote_machine(tmp_path, s3_url, "reader").read(ARTIFACT, "facts.json")
    assert winner in {b"0", b"1", b"2", b"3"}


def test_what_only_the_cache_holds_is_sent_again(tmp_path: Path, s3_url: str) -> None:
    one, two = (remote_machine(tmp_path, s3_url, name) for name in ("one", "two"))
    make(one)
    assert not two.holds(ARTIFACT)
    assert one.holds(ARTIFACT)
    assert content(two.fetch(ARTIFACT)) == FILES


def test_a_damaged_copy_in_the_cache_is_downloaded_again(tmp_path: Path, s3_url: str) -> None:
    store = remote_machine(tmp_path, s3_url, "one")
    make(store)
    store.push(ADDRESS)
    (store.path(ADDRESS) / "sub" / "0.0").write_bytes(b"torn")
    assert content(store.fetch(ARTIFACT)) == FILES


def test_packs_larger_than_a_request_arrive_whole(tmp_path: Path, s3_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.storage.remote.RANGE_BYTES", 6 << 20)
    monkeypatch.setattr("services.storage.tiered.RANGE_BYTES", 6 << 20)
    one, two = (remote_machine(tmp_path, s3_url, name) for name in ("one", "two"))
    files = {"a": os.urandom(7 << 20), "b": os.urandom(6 << 20), "c": b"", "d": os.urandom(100)}
    make(one, files=files)
    one.push(ADDRESS)
    assert two.read(ARTIFACT, "d") == files["d"]
    assert content(two.fetch(ARTIFACT)) == files


def test_packs_that_a_crash_left_are_removed_when_they_are_old(tmp_path: Path, s3_url: str) -> None:
    store = remote_machine(tmp_path, s3_url, "one")
    make(store)
    store.push(ADDRESS)
    meta, pack = sorted(objects(s3_url))
    remote = Remote.open(s3_url)
    second, other = f"{meta.rpartition('/')[0]}/pack-left", f"artifacts/label/00/{'0' * 64}/pack-left"
    for key in (second, other):
        remote.put(key, b"half")
    (entry,) = (entry for entry in remote.list("artifacts") if entry.key == other)
    store.clean(entry.modified + ORPHAN_SECONDS - 60)
    assert set(objects(s3_url)) == {meta, pack, second, other}
    store.clean(entry.modified + ORPHAN_SECONDS + 60)
    assert set(objects(s3_url)) == {meta, pack}
