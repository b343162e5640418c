from __future__ import annotations

from pathlib import Path

import pytest

from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from services.database import open_database
from services.problems import Refusal, document_of
from services.scenes import QUOTA_CHECKS, Scenes
from services.storage import Blobs


class _Checks:
    def __init__(self) -> None:
        self.asked: list[str] = []

    def check_next(self, scene_id: str) -> None:
        self.asked.append(scene_id)


@pytest.fixture
def checks() -> _Checks:
    return _Checks()


@pytest.fixture
def scenes(database_url: str, tmp_path: Path, checks: _Checks) -> Scenes:
    return Scenes(open_database(database_url), Blobs(tmp_path / "store"), checks)


@pytest.fixture
def sha256(tmp_path: Path, scenes: Scenes) -> str:
    return Blobs(tmp_path / "store").put_bytes(b"#usda 1.0\n").sha256


def test_the_same_files_are_the_same_scene_and_are_checked_once(scenes: Scenes, sha256: str, checks: _Checks) -> None:
    files = {"a.usda": sha256, "textures/b.png": sha256}
    record, new = scenes.create("one", "a.usda", files, "key_1")
    assert (new, record.state, record.bytes) == (True, "checking", 20)
    again, new = scenes.create("another name", "a.usda", dict(reversed(files.items())), "key_2")
    assert (new, again.id, again.name) == (False, record.id, "one")
    scenes.resolve_check(record.id, {"triangles": 3})
    known, new = scenes.create("one", "a.usda", files, "key_1")
    assert (new, known.state, known.facts) == (False, "accepted", {"triangles": 3})
    assert checks.asked == [record.id, record.id]
    assert scenes.create("one", "a.usda", {"a.usda": sha256}, "key_1")[0].id != record.id


def test_only_the_first_result_of_a_check_counts(scenes: Scenes, sha256: str) -> None:
    record, _ = scenes.create("one", "a.usda", {"a.usda": sha256}, "key_1")
    scenes.resolve_check(record.id, None, document_of(Problem("It is bad.", "Send another.", ExitCode.CHECK_FAILED)))
    scenes.resolve_check(record.id, {"triangles": 3})
    found = scenes.get(record.id)
    assert (found.state, found.facts) == ("rejected", None)
    assert found.problem is not None
    assert (found.problem.detail, found.problem.type) == ("It is bad.", "/v1/problems/check-failed")


def test_files_that_were_not_uploaded_are_named(scenes: Scenes, sha256: str) -> None:
    with pytest.raises(Refusal) as refused:
        scenes.create("one", "a.usda", {"a.usda": sha256, "b.usda": "0" * 64}, "key_1")
    assert refused.value.more == {"missing": ["0" * 64]}


@pytest.mark.parametrize(
    "path",
    [
        *("../a.usda", "/a.usda", "a/../b.usda", "./a.usda", "a//b.usda", "a\\b.usda", "c:a.usda", "a\nb.usda"),
        *("", "..", "a/", " ", "a\0.usda", "a\u202eb.usda", "x" * 300 + ".usda", "http://a/b.usda"),
    ],
)
def test_a_path_that_could_lead_elsewhere_is_refused(path: str, scenes: Scenes, sha256: str) -> None:
    with pytest.raises(Problem, match="not a plain relative path"):
        scenes.create("one", path, {path: sha256}, "key_1")


def test_a_key_has_so_many_scenes_waiting_and_another_one_is_not_concerned(scenes: Scenes, sha256: str) -> None:
    made = [scenes.create("one", "a.usda", {"a.usda": sha256, f"{n}": sha256}, "key_1")[0] for n in range(QUOTA_CHECKS)]
    with pytest.raises(Refusal) as refused:
        scenes.create("one", "a.usda", {"a.usda": sha256, "more": sha256}, "key_1")
    assert (refused.value.type.status, refused.value.headers) == (429, {"Retry-After": "10"})
    assert scenes.create("known", "a.usda", {"a.usda": sha256, "0": sha256}, "key_1")[0].id == made[0].id
    scenes.create("one", "a.usda", {"a.usda": sha256, "other": sha256}, "key_2")
    scenes.resolve_check(made[0].id, {"triangles": 3})
    scenes.create("one", "a.usda", {"a.usda": sha256, "more": sha256}, "key_1")


@pytest.mark.parametrize("paths", [["a.usda", "A.usda"], ["a.usda", "a.usda/b.png"]])
def test_names_that_clash_on_some_file_system_are_refused(paths: list[str], scenes: Scenes, sha256: str) -> None:
    with pytest.raises(Problem, match="cannot tell apart"):
        scenes.create("one", paths[0], dict.fromkeys(paths, sha256), "key_1")


@pytest.mark.parametrize("root", ["b.usda", "a.png", "a.exr"])
def test_the_root_has_to_be_a_scene_among_the_files(root: str, scenes: Scenes, sha256: str) -> None:
    with pytest.raises(Problem, match="The root of the scene"):
        scenes.create("one", root, {"a.usda": sha256, "a.png": sha256}, "key_1")


def test_too_many_files_and_bytes_are_refused(
    scenes: Scenes, sha256: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(Problem, match="at most 4096 files") as refused:
        scenes.create("one", "0.usda", {f"{n}.usda": sha256 for n in range(LIMITS.scene_files + 1)}, "key_1")
    assert refused.value.code is ExitCode.LIMIT
    monkeypatch.setattr(Blobs, "size", lambda *_: LIMITS.upload_bytes // 2 + 1)
    with pytest.raises(Problem, match="more than 2147483648 bytes"):
        scenes.create("one", "0.usda", {"0.usda": sha256, "1.usda": sha256}, "key_1")


def test_pages_are_stable_while_scenes_come(scenes: Scenes, sha256: str) -> None:
    ids = [scenes.create("s", f"{n}.usda", {f"{n}.usda": sha256}, "key_1")[0].id for n in range(5)]
    first = scenes.list(limit=2)
    assert [scene.id for scene in first] == ids[:2:-1]
    assert len(scenes.many([*ids, "scn_none"])) == 5
    with pytest.raises(Problem, match="no scene scn_none"):
        scenes.get("scn_none")
