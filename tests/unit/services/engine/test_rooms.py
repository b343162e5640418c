"""Rooms: what is in them for a task, who may meet whom in them, and what is left of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.workers import ROOT

from schemas.canonical import canonical_json
from services.engine.children import Assignment, Child, ChildOptions, Hooks, Spawner
from services.engine.rooms import KERNELS, Room, Scratch, link_tree
from stages.store import Address, Store
from stages.tasks import Task

HOLDER = """
import sys, time
from pathlib import Path
from services.engine.rooms import Room, Scratch
scratch = Scratch(Path(sys.argv[1]))
Room(scratch.folder / "render-0").open()
print(scratch.folder, flush=True)
time.sleep(600)
"""


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "store")


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Child]:
    """One that is shut in, and may write down what it does."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(ROOT / "tests")]))
    monkeypatch.setenv("PXR_AR_DEFAULT_SEARCH_PATH", str(tmp_path))
    (tmp_path / "traces").mkdir()
    options = ChildOptions(
        make="support.bodies:make",
        inspect="support.rooms:inspect",
        sandbox="services.sandbox:enter",
        scratch=tmp_path / "work",
        kernels=tmp_path / "kernels",
        read=(ROOT / "tests",),
        write=(tmp_path / "traces",),
    )
    found = Child(options, Spawner(), "render-0")
    yield found
    found.stop()


def _made(child: Child, store: Store, folder: Path, name: str, *needs: Task, subject: str | None = None) -> Task:
    task = Task(
        name=name,
        stage="label" if needs else "render",
        version="1",
        params={"trace": str(folder / "traces" / "trace"), "name": name},
        needs=tuple(need.artifact for need in needs),
    )
    assignment = Assignment(subject, {need: store.fetch(need) for need in task.needs})
    child.call(name, {"task": task.model_dump(mode="json")}, 30.0, Hooks(), assignment)
    store.adopt(child.room.artifact(task.address), task.artifact)
    return task


def _seen(child: Child, assignment: Assignment, *paths: Path) -> dict[str, str]:
    """What a child finds at paths, and where it works."""
    request = {"source": "s", "root": canonical_json([str(path) for path in paths])}
    facts: dict[str, str] = child.call("look", request, 30.0, Hooks(), assignment)["facts"]
    return facts


def test_a_child_sees_the_inputs_of_its_task_and_no_others(child: Child, store: Store, tmp_path: Path) -> None:
    first = _made(child, store, tmp_path, "first")
    second = _made(child, store, tmp_path, "second", first)
    address, pid = first.address, child.pid
    needs, secret = child.room.needs, tmp_path / "secret"
    secret.write_text("secret")
    source = tmp_path / "source"
    source.mkdir()
    (source / "scene.usda").write_text("#usda 1.0")
    own = Assignment(sources={"s": source})
    inside = child.room.sources / "s" / "scene.usda"
    asked = (inside, needs / first.artifact / "facts.json", store.path(address) / "facts.json", secret, source)
    seen = _seen(child, own, *asked, Path("secret"), child.room.made / "label")
    assert seen.pop("cwd") == str(child.room.empty)
    assert seen.pop("search") == ""
    assert seen == {
        str(inside): "#usda 1.0",
        str(needs / first.artifact / "facts.json"): "FileNotFoundError",
        str(store.path(address) / "facts.json"): "PermissionError",
        str(secret): "PermissionError",
        str(source): "PermissionError",
        "secret": "FileNotFoundError",
        str(child.room.made / "label"): "FileNotFoundError",
    }
    with_first = Assignment(needs={first.artifact: store.path(address)}, sources={"s": source})
    found = _seen(child, with_first, needs / first.artifact / "facts.json", needs / second.artifact / "facts.json")
    assert sorted(found.values())[-1] == '{"name": "first"}'
    assert found[str(needs / second.artifact / "facts.json")] == "FileNotFoundError"
    assert child.pid == pid, "all of it in one process"


def test_a_process_that_met_a_scene_meets_no_other_one(child: Child, store: Store, tmp_path: Path) -> None:
    pids = []
    for number, subject in enumerate((None, "a", "a", "b", None, None)):
        _made(child, store, tmp_path, f"task{number}", subject=subject)
        pids.append(child.pid)
    assert pids[0] == pids[1] == pids[2]
    assert pids[4] == pids[5]
    assert len(set(pids)) == 3


def test_what_was_compiled_for_one_key_is_loaded_for_no_other(child: Child, store: Store, tmp_path: Path) -> None:
    source = tmp_path / "source"
    source.mkdir()
    planted = tmp_path / "kernels" / "key_a" / "kernel.nbc"
    planted.parent.mkdir(parents=True)
    planted.write_text("code")
    seen, pids = {}, set()
    for owner in ("key_a", "key_b", ""):
        seen[owner] = _seen(child, Assignment(sources={"s": source}, owner=owner), planted)[str(planted)]
        pids.add(child.pid)
    assert seen == {"key_a": "code", "key_b": "PermissionError", "": "PermissionError"}
    assert len(pids) == 3, "what one key's process has loaded goes with it"


def test_a_store_that_comes_back_as_another_folder_is_used_by_the_same_process(
    child: Child, store: Store, tmp_path: Path
) -> None:
    first = _made(child, store, tmp_path, "first")
    pid = child.pid
    shutil.copytree(store.root, tmp_path / "copy")
    shutil.rmtree(store.root)
    (tmp_path / "copy").rename(store.root)
    _made(child, store, tmp_path, "second", first)
    shutil.rmtree(store.root)
    store.root.mkdir()
    _made(child, store, tmp_path, "third")
    assert child.pid == pid


def test_a_child_whose_room_went_away_gets_a_new_one(child: Child, store: Store, tmp_path: Path) -> None:
    _made(child, store, tmp_path, "first")
    pid = child.pid
    shutil.rmtree(tmp_path / "work")
    _made(child, store, tmp_path, "second")
    assert child.pid != pid


def test_what_is_no_whole_artifact_is_not_taken_over(store: Store, tmp_path: Path) -> None:
    address = Address("render", "1")
    room = Store(tmp_path / "room")
    (tmp_path / "secret").write_text("secret")

    def tampered(change: str) -> Path:
        with room.put(address) as folder:
            (folder / "facts.json").write_text("{}")
        made = room.path(address)
        if change == "link":
            (made / "facts.json").unlink()
            (made / "facts.json").symlink_to(tmp_path / "secret")
        elif change == "pipe":
            os.mkfifo(made / "pipe")
        elif change == "folder":
            (made / "below").symlink_to(tmp_path, target_is_directory=True)
        elif change == "more":
            (made / "more").write_text("more")
        elif change == "less":
            (made / "facts.json").unlink()
        elif change == "none":
            (made / "meta.json").unlink()
        return made

    for change in ("link", "pipe", "folder", "more", "less", "none"):
        made = tampered(change)
        with pytest.raises(ValueError, match="What was made"):
            store.adopt(made, address.artifact)
        shutil.rmtree(made)
    made = tampered("nothing")
    with pytest.raises(ValueError, match="belongs to another artifact"):
        store.adopt(made, Address("render", "2").artifact)
    store.adopt(made, address.artifact)
    assert store.fetch(address.artifact) == store.path(address)


def test_an_artifact_from_another_file_system_is_copied(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address, room = Address("render", "1"), Store(tmp_path / "room")
    with room.put(address) as folder:
        (folder / "facts.json").write_text("{}")
    rename, made = Path.rename, room.path(address)

    def across(self: Path, target: Path) -> Path:
        if self == made:
            raise OSError(18, "Invalid cross-device link")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", across)
    store.adopt(made, address.artifact)
    assert (store.fetch(address.artifact) / "facts.json").read_text() == "{}"
    assert list((store.root / "tmp").iterdir()) == []


def test_files_are_linked_or_else_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "from" / "below").mkdir(parents=True)
    (tmp_path / "from" / "below" / "a").write_text("a")
    link_tree(tmp_path / "from", tmp_path / "linked")
    assert (tmp_path / "linked" / "below" / "a").samefile(tmp_path / "from" / "below" / "a")

    def across(*_: object, **__: object) -> None:
        raise OSError(18, "Invalid cross-device link")

    monkeypatch.setattr(os, "link", across)
    link_tree(tmp_path / "from", tmp_path / "copied")
    assert (tmp_path / "copied" / "below" / "a").read_text() == "a"
    assert not (tmp_path / "copied" / "below" / "a").samefile(tmp_path / "from" / "below" / "a")


def test_the_rooms_of_the_dead_are_removed_and_those_of_the_living_stay(tmp_path: Path) -> None:
    work = tmp_path / "work"
    (work / "render-4711-0").mkdir(parents=True)
    (work / KERNELS).mkdir()
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", HOLDER, str(work)]
    holders = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) for _ in range(2)]
    folders = [Path(holder.stdout.readline().strip()) for holder in holders if holder.stdout]
    assert all((folder / "render-0" / "made").is_dir() for folder in folders)
    holders[0].kill()
    holders[0].wait()
    scratch = Scratch(work)
    assert {path for path in work.iterdir() if path.is_dir()} == {folders[1], scratch.folder, work / KERNELS}
    holders[1].kill()
    holders[1].wait()
    assert scratch.sweep() == 1
    scratch.close()
    assert {path for path in work.iterdir() if path.is_dir()} == {work / KERNELS}


def test_a_room_holds_nothing_of_the_task_before(tmp_path: Path) -> None:
    room, given = Room(tmp_path / "room"), tmp_path / "given"
    given.mkdir()
    (given / "a").write_text("a")
    room.open()
    room.fill({"render/" + "0" * 64: given}, {"s": given})
    (room.made / "render").mkdir()
    (room.made / "tmp").mkdir()
    room.fill({}, {})
    left = {path.relative_to(room.folder).as_posix() for path in room.folder.rglob("*")}
    assert left == {"empty", "needs", "sources", "made", "made/tmp", "tmp"}
    assert (given / "a").read_text() == "a"
