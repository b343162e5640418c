from __future__ import annotations

import hashlib
import threading
from pathlib import Path

import pytest

from schemas.problem import ExitCode, Problem
from services import uploads as module
from services.database import open_database
from services.problems import Refusal
from services.storage import Blobs
from services.uploads import Upload, Uploads

DATA = bytes(range(256)) * 4
HASH = hashlib.sha256(DATA).hexdigest()


@pytest.fixture
def blobs(tmp_path: Path) -> Blobs:
    return Blobs(tmp_path / "store")


@pytest.fixture
def uploads(database_url: str, blobs: Blobs) -> Uploads:
    return Uploads(open_database(database_url), blobs)


def _begin(uploads: Uploads, sha256: str = HASH, size: int = len(DATA)) -> Upload:
    upload = uploads.begin(sha256, size, "key_1")
    assert upload is not None
    return upload


def test_parts_become_a_blob(uploads: Uploads, blobs: Blobs) -> None:
    upload = _begin(uploads)
    assert uploads.append(upload.id, 0, DATA[:100]).received == 100
    assert not uploads.get(upload.id).complete
    assert uploads.append(upload.id, 100, DATA[100:]).complete
    assert b"".join(blobs.read(HASH)) == DATA
    assert uploads.begin(HASH, len(DATA), "key_1") is None
    assert uploads.get(upload.id).complete


def test_an_upload_goes_on_where_it_stopped(uploads: Uploads) -> None:
    upload = _begin(uploads)
    uploads.append(upload.id, 0, DATA[:10])
    again = _begin(uploads)
    assert (again.id, again.received) == (upload.id, 10)
    other = uploads.begin(HASH, len(DATA), "key_2")
    assert other is not None
    assert other.id != upload.id


@pytest.mark.parametrize("offset", [0, 9, 11])
def test_a_part_in_the_wrong_place_is_told_where_to_go_on(uploads: Uploads, offset: int) -> None:
    upload = _begin(uploads)
    uploads.append(upload.id, 0, DATA[:10])
    with pytest.raises(Refusal) as refused:
        uploads.append(upload.id, offset, DATA[offset : offset + 10])
    assert refused.value.more == {"received": 10}


def test_other_content_is_refused_and_forgotten(uploads: Uploads, blobs: Blobs) -> None:
    upload = _begin(uploads)
    with pytest.raises(Problem, match="have the sha256") as refused:
        uploads.append(upload.id, 0, DATA[::-1])
    assert refused.value.code is ExitCode.CHECK_FAILED
    assert not blobs.has(HASH)
    with pytest.raises(Problem, match="no upload"):
        uploads.get(upload.id)


def test_of_many_parts_at_the_same_place_one_is_taken(uploads: Uploads, blobs: Blobs) -> None:
    """Also when they differ in length, as the parts of a client that lost its patience do."""
    upload = _begin(uploads)
    outcomes: list[str] = []
    gate = threading.Barrier(8)

    def send(size: int) -> None:
        gate.wait()
        try:
            outcomes.append(f"{uploads.append(upload.id, 0, DATA[:size]).received}")
        except Refusal as refused:
            outcomes.append(refused.type.slug)

    threads = [threading.Thread(target=send, args=(10 * (n + 1),)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert outcomes.count("wrong-offset") == 7
    received = uploads.get(upload.id).received
    assert str(received) in outcomes
    assert uploads.append(upload.id, received, DATA[received:]).complete
    assert b"".join(blobs.read(HASH)) == DATA


def test_a_whole_upload_is_verified_again_on_request(
    uploads: Uploads, blobs: Blobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    upload = _begin(uploads)

    def fail(*_: object) -> None:
        raise OSError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(blobs, "assemble", fail)
        with pytest.raises(OSError, match="full"):
            uploads.append(upload.id, 0, DATA)
    assert uploads.get(upload.id).received == len(DATA)
    assert uploads.append(upload.id, len(DATA), b"").complete


def test_more_than_announced_is_refused(uploads: Uploads) -> None:
    upload = _begin(uploads)
    with pytest.raises(Problem, match="beyond the end"):
        uploads.append(upload.id, 0, DATA + b"x")
    assert uploads.get(upload.id).received == 0


def test_an_empty_file_needs_no_part(uploads: Uploads, blobs: Blobs) -> None:
    empty = hashlib.sha256().hexdigest()
    assert uploads.begin(empty, 0, "key_1") is None
    assert blobs.size(empty) == 0
    with pytest.raises(Problem, match="empty file"):
        uploads.begin(HASH, 0, "key_1")


def test_a_key_has_a_quota_until_its_uploads_are_done(uploads: Uploads, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "QUOTA_BYTES", 1500)
    upload = _begin(uploads)
    with pytest.raises(Problem, match="1500 bytes in all") as refused:
        uploads.begin("0" * 64, 600, "key_1")
    assert refused.value.code is ExitCode.LIMIT
    assert uploads.begin("0" * 64, 600, "key_2") is not None
    uploads.delete(upload.id)
    assert uploads.begin("0" * 64, 600, "key_1") is not None
    with pytest.raises(Problem, match="no upload"):
        uploads.delete(upload.id)
