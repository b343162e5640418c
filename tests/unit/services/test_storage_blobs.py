"""Blobs in a folder and in an object store: named by their hash, never torn, healed by storing them again."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any

import obstore
import pytest
from hypothesis import given
from hypothesis import strategies as st
from obstore.exceptions import GenericError

from schemas.canonical import file_sha256
from schemas.problem import ExitCode, Problem
from services.settings import Settings
from services.storage import MissingBlob, Storage, open_storage
from services.storage import blobs as module
from services.storage.blobs import Blobs
from services.storage.remote import Remote

UPLOAD = "upl_" + "ab" * 12
Machine = Callable[[str], Storage]


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def blob_key(name: str) -> str:
    return f"blobs/sha256/{name[:2]}/{name}"


def test_bytes_come_back_by_their_hash(machine: Machine, tmp_path: Path) -> None:
    one, two = machine("one").blobs, machine("two").blobs
    data = os.urandom(3 << 20)
    (tmp_path / "file").write_bytes(data)
    name = sha256(data)
    assert not one.has(name)
    assert one.size(name) is None
    assert one.put_file(tmp_path / "file").model_dump() == {"sha256": name, "bytes": len(data)}
    assert one.put_bytes(data).sha256 == name
    assert two.has(name)
    assert two.size(name) == len(data)
    assert two.path(name).read_bytes() == data
    assert b"".join(two.read(name)) == data
    assert b"".join(two.read(name, 5, 2_000_000)) == data[5:2_000_000]
    assert b"".join(two.read(name, len(data) - 3)) == data[-3:]
    assert max(map(len, two.read(name))) <= 1 << 20
    ((listed, size, _),) = two.all()
    assert (listed, size) == (name, len(data))


def test_no_bytes_are_bytes(machine: Machine) -> None:
    reference = machine("one").blobs.put_bytes(b"")
    assert b"".join(machine("two").blobs.read(reference.sha256)) == b""


def test_a_blob_that_is_not_there_says_so_at_the_call(machine: Machine) -> None:
    for name in ("0" * 64, "../../etc/passwd", "0" * 63 + "G"):
        assert not machine("one").blobs.has(name)
        for read in (machine("one").blobs.read, machine("one").blobs.path):
            with pytest.raises(MissingBlob) as caught:
                read(name)
            assert caught.value.code == ExitCode.NOT_FOUND


def test_a_removed_blob_is_gone_for_all(machine: Machine) -> None:
    one = machine("one").blobs
    name = one.put_bytes(b"data").sha256
    one.remove(name)
    one.remove(name)
    assert not machine("two").blobs.has(name)
    with pytest.raises(MissingBlob):
        one.path(name)


def test_a_damaged_blob_is_missing_until_it_is_stored_again(tmp_path: Path) -> None:
    blobs = Blobs(tmp_path)
    name = blobs.put_bytes(b"data").sha256
    blobs.path(name).write_bytes(b"date")
    os.utime(tmp_path / blob_key(name), (1, 1))
    for reader in (blobs, Blobs(tmp_path)):
        with pytest.raises(MissingBlob):
            reader.path(name)
    assert len(list((tmp_path / "damaged").iterdir())) == 1
    blobs.put_bytes(b"data")
    assert blobs.path(name).read_bytes() == b"data"


def test_storing_heals_a_blob_that_nobody_has_noticed_to_be_damaged(tmp_path: Path) -> None:
    name = Blobs(tmp_path).put_bytes(b"data").sha256
    (tmp_path / blob_key(name)).write_bytes(b"date")
    Blobs(tmp_path).put_bytes(b"data")
    assert Blobs(tmp_path).path(name).read_bytes() == b"data"


@pytest.mark.parametrize("torn", [b"", b"dat", b"date", b"data and more"])
def test_a_blob_that_is_damaged_in_the_object_store_is_removed_there(torn: bytes, tmp_path: Path, s3_url: str) -> None:
    one, two = (open_storage(Settings(state=tmp_path / name, store=s3_url)).blobs for name in ("one", "two"))
    name = one.put_bytes(b"data").sha256
    Remote.open(s3_url).put(blob_key(name), torn)
    with pytest.raises(MissingBlob):
        two.path(name)
    assert not two.has(name)
    two.put_bytes(b"data")
    assert b"".join(open_storage(Settings(state=tmp_path / "three", store=s3_url)).blobs.read(name)) == b"data"


@pytest.mark.parametrize("known", [False, True], ids=["as it was stored", "handed out before"])
def test_a_blob_of_the_same_size_and_times_is_hashed_before_it_is_handed_out(tmp_path: Path, known: bool) -> None:
    """Also by the process that stored it: what lies there now is not what went through its hands."""
    blobs = Blobs(tmp_path)
    name = blobs.put_bytes(b"data").sha256
    path = blobs.path(name) if known else next(tmp_path.rglob(name))
    stat = path.stat()
    path.write_bytes(b"DATA")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (stat.st_size, stat.st_mtime_ns)
    with pytest.raises(MissingBlob):
        blobs.path(name)


def test_a_use_is_no_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blobs = Blobs(tmp_path)
    name = blobs.put_bytes(b"data").sha256
    hashed = []
    monkeypatch.setattr(module, "file_sha256", lambda path: hashed.append(path) or file_sha256(path))
    monkeypatch.setattr(module, "TOUCH_SECONDS", -1.0)
    for _ in range(3):
        blobs.path(name)
    assert len(hashed) == 1


def test_a_store_that_is_away_says_so_and_not_that_a_blob_is_missing(tmp_path: Path) -> None:
    blobs = Blobs(tmp_path / "store")
    name = blobs.put_bytes(b"data").sha256
    (tmp_path / "store").rename(tmp_path / "elsewhere")
    for attempt in (
        lambda: blobs.path(name),
        lambda: blobs.has(name),
        lambda: blobs.put_bytes(b"more"),
        lambda: blobs.append_part(UPLOAD, 0, b"data"),
        blobs.probe,
    ):
        with pytest.raises(Problem, match="cannot be reached") as away:
            attempt()
        assert away.value.code is ExitCode.TRY_AGAIN
    (tmp_path / "elsewhere").rename(tmp_path / "store")
    blobs.probe()
    assert blobs.path(name).read_bytes() == b"data"
    assert list((tmp_path / "store" / "tmp").iterdir()) == []


def test_an_open_blob_is_read_to_its_end_although_it_is_removed(machine: Machine) -> None:
    blobs = machine("one").blobs
    data = os.urandom(3 << 20)
    name = blobs.put_bytes(data).sha256
    stream = blobs.read(name)
    first = next(stream)
    blobs.remove(name)
    assert first + b"".join(stream) == data


def test_a_full_disk_is_an_os_error_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blobs = Blobs(tmp_path)

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space left"):
            blobs.put_bytes(b"data")
        with pytest.raises(OSError, match="No space left"):
            blobs.append_part(UPLOAD, 0, b"data")
    assert not blobs.has(sha256(b"data"))
    assert list((tmp_path / "tmp").iterdir()) == []
    assert [path for path in (tmp_path / "uploads").rglob("*") if path.is_file()] == []


def test_writers_of_the_same_blob_do_not_disturb_each_other(machine: Machine) -> None:
    data = os.urandom(1 << 20)
    stores = [machine(f"m{i}").blobs for i in range(4)]
    with ThreadPoolExecutor(8) as pool:
        references = list(pool.map(lambda i: stores[i % 4].put_bytes(data), range(16)))
    assert {reference.sha256 for reference in references} == {sha256(data)}
    assert all(b"".join(store.read(sha256(data))) == data for store in stores)


def test_an_upload_in_parts_becomes_a_blob(machine: Machine) -> None:
    one, two = machine("one").blobs, machine("two").blobs
    data = os.urandom(100_000)
    one.append_part(UPLOAD, 0, data[:40_000])
    one.append_part(UPLOAD, 40_000, b"a part that its sender never heard the answer of")
    two.append_part(UPLOAD, 40_000, data[40_000:])
    assert [upload for upload, _ in two.uploads()] == [UPLOAD]
    reference = two.assemble(UPLOAD, sha256(data), len(data))
    assert b"".join(one.read(reference.sha256)) == data
    assert list(one.uploads()) == []
    assert one.assemble(UPLOAD, sha256(data), len(data)) == reference


def test_an_upload_with_a_hole_is_not_assembled_and_can_be_completed(machine: Machine) -> None:
    blobs = machine("one").blobs
    blobs.append_part(UPLOAD, 0, b"01234")
    blobs.append_part(UPLOAD, 7, b"789")
    with pytest.raises(Problem, match="first 5 of 10 bytes") as caught:
        blobs.assemble(UPLOAD, sha256(b"0123456789"), 10)
    assert caught.value.code == ExitCode.CONFLICT
    blobs.append_part(UPLOAD, 5, b"56")
    assert blobs.assemble(UPLOAD, sha256(b"0123456789"), 10).bytes == 10


def test_an_upload_of_other_bytes_is_refused_and_its_parts_removed(machine: Machine) -> None:
    blobs = machine("one").blobs
    blobs.append_part(UPLOAD, 0, b"0123456789")
    with pytest.raises(Problem, match="Upload the file again") as caught:
        blobs.assemble(UPLOAD, sha256(b"other"), 10)
    assert caught.value.code == ExitCode.CHECK_FAILED
    assert list(blobs.uploads()) == []
    assert list(blobs.all()) == []


def test_an_upload_that_is_discarded_leaves_nothing(machine: Machine) -> None:
    blobs = machine("one").blobs
    blobs.append_part(UPLOAD, 0, b"01234")
    blobs.discard(UPLOAD)
    blobs.discard(UPLOAD)
    assert list(blobs.uploads()) == []


@pytest.mark.parametrize("upload", ["../../x", "upl_", "upl_" + "g" * 24, ""])
def test_other_names_are_no_uploads(upload: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="not the id of an upload"):
        Blobs(tmp_path).append_part(upload, 0, b"")


@given(st.binary(max_size=200), st.lists(st.integers(0, 200)), st.randoms(use_true_random=False))
def test_however_an_upload_is_cut_and_repeated_the_blob_is_the_file(
    tmp_path_factory: pytest.TempPathFactory, data: bytes, cuts: list[int], random: Any
) -> None:
    blobs = Blobs(tmp_path_factory.mktemp("blobs"))
    places = sorted({0, len(data), *(cut for cut in cuts if cut < len(data))})
    parts = [(start, data[start:end]) for start, end in pairwise(places)]
    for start, part in random.sample(parts, len(parts)) + parts[:2]:
        blobs.append_part(UPLOAD, start, part)
    assert b"".join(blobs.read(blobs.assemble(UPLOAD, sha256(data), len(data)).sha256)) == data


def test_a_use_is_written_down(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("services.storage.remote.USED_SECONDS", -1)
    blobs = machine("one").blobs
    path = blobs.path(blobs.put_bytes(b"data").sha256)
    past = path.stat().st_mtime - 1_000_000
    os.utime(path, (past, past))
    assert machine("two").blobs.has(path.name)
    ((_, _, last_used),) = blobs.all()
    assert last_used > past + 900_000


@pytest.mark.parametrize("url", ["gs://bucket/prefix", "http://host/x", "s3://", "s3:///prefix"])
def test_a_store_that_is_not_understood_says_what_to_set(url: str, tmp_path: Path) -> None:
    with pytest.raises(Problem, match="DIAPHANE_STORE"):
        open_storage(Settings(state=tmp_path, store=url))


def test_an_object_store_that_is_down_or_has_no_bucket_is_a_problem(
    tmp_path: Path, s3_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(Problem, match="bucket of the object store does not exist"):
        open_storage(Settings(state=tmp_path, store="s3://no-such-bucket/x")).blobs.put_bytes(b"data")
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(Problem, match="cannot be reached") as caught:
        open_storage(Settings(state=tmp_path, store=s3_url), patience=0.2).blobs.has("0" * 64)
    assert caught.value.code == ExitCode.TRY_AGAIN


def test_a_request_whose_connection_was_cut_is_sent_again(s3_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    remote, cut = Remote.open(s3_url), list[str]()

    def once(name: str) -> None:
        asked = getattr(obstore, name)

        def ask(*arguments: object, **options: object) -> object:
            answer = asked(*arguments, **options)
            if name in cut:
                return answer
            cut.append(name)  # what was asked for has been done, and nobody knows
            raise GenericError("Generic S3 error: HTTP error: error sending request")

        monkeypatch.setattr(f"services.storage.remote.obstore.{name}", ask)

    for name in ("put", "get", "head", "get_range"):
        once(name)
    assert remote.create("a", b"content"), "it was this one that made it"
    assert not remote.create("a", b"another")
    assert remote.head("a") is not None
    found = remote.get("a")
    assert found is not None
    assert found[0] == b"content"
    assert b"".join(remote.range("a", 0, 7)) == b"content"
    assert sorted(cut) == ["get", "get_range", "head", "put"]
