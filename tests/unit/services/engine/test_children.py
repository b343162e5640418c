"""Child processes: what they answer, and how they end."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from support.workers import ROOT, alive, until

from schemas.problem import ExitCode, Problem
from services.engine.children import Child, ChildOptions, Hooks, Lost, Spawner
from services.engine.problems import TaskError
from stages.store import MissingArtifact, Store
from stages.tasks import Task


@pytest.fixture
def child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Child]:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), str(ROOT / "tests")]))
    monkeypatch.setenv("DIAPHANE_DATABASE", "postgresql://u:hunter2@h/d")
    options = ChildOptions(
        make="support.bodies:make",
        inspect="support.bodies:inspect",
        sandbox="",
        scratch=tmp_path / "work",
        kernels=tmp_path / "kernels",
    )
    found = Child(options, Spawner(), "render-0")
    yield found
    found.stop()


def _task(folder: Path, **params: object) -> dict[str, object]:
    asked = Task(name="t", stage="render", version="1", params={"trace": str(folder / "trace"), **params})
    return {"task": asked.model_dump(mode="json")}


def test_a_child_is_used_again_and_tells_what_it_took(child: Child, tmp_path: Path) -> None:
    said: list[tuple[float, str]] = []
    hooks = Hooks(progress=lambda fraction, note: said.append((fraction, note)))
    answer = child.call("t", _task(tmp_path, sleep=0.5), 20.0, hooks)
    pid = child.pid
    assert answer["usage"]["peak_bytes"] > 1 << 20
    assert said[0][1] == "working"
    assert 0.0 <= said[0][0] < 1.0
    child.call("t", _task(tmp_path, other=1), 20.0, Hooks())
    assert child.pid == pid
    assert len(list(Store(child.room.made).artifacts())) == 1, "what the task before it made is gone"


def test_what_a_body_raises_comes_back_as_what_it_is(child: Child, tmp_path: Path) -> None:
    lines: list[str] = []
    with pytest.raises(Problem, match="The view is empty") as problem:
        child.call("t", _task(tmp_path, fault="problem"), 20.0, Hooks())
    assert problem.value.code is ExitCode.CHECK_FAILED
    missing = Task(
        name="t", stage="render", version="1", needs=("scene/" + "0" * 64,), params={"trace": str(tmp_path / "t")}
    )
    with pytest.raises(MissingArtifact, match="scene/0000"):
        child.call("t", {"task": missing.model_dump(mode="json")}, 20.0, Hooks())
    with pytest.raises(TaskError, match="ValueError: bad luck"):
        child.call("t", _task(tmp_path, fault="raise"), 20.0, Hooks(line=lines.append))
    assert lines[0].startswith("Traceback")


def test_a_crash_names_the_signal_and_the_next_task_has_a_new_process(child: Child, tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="SIGSEGV"):
        child.call("the task", _task(tmp_path, fault="crash"), 20.0, Hooks())
    child.call("t", _task(tmp_path), 20.0, Hooks())


def test_a_task_that_takes_too_long_is_killed(child: Child, tmp_path: Path) -> None:
    child.call("t", _task(tmp_path), 20.0, Hooks())
    pid = child.pid
    assert pid is not None
    with pytest.raises(TaskError, match=r"the task was not done within 0\.5 s"):
        child.call("the task", _task(tmp_path, sleep=30.0), 0.5, Hooks())
    assert not alive(pid)


def test_a_lost_task_ends_at_once_even_if_it_was_lost_before_it_began(child: Child, tmp_path: Path) -> None:
    begun = time.monotonic()
    threading.Timer(1.0, child.lose).start()
    with pytest.raises(Lost):
        child.call("t", _task(tmp_path, sleep=30.0), 60.0, Hooks())
    with pytest.raises(Lost):
        child.call("t", _task(tmp_path, sleep=30.0), 60.0, Hooks())
    assert time.monotonic() - begun < 20.0
    child.renew()
    child.call("t", _task(tmp_path), 20.0, Hooks())


def test_a_child_that_is_shut_in_makes_artifacts_and_nothing_else(child: Child, tmp_path: Path) -> None:
    (tmp_path / "traces").mkdir()
    shut = replace(
        child._options,
        sandbox="services.sandbox:enter",
        read=(ROOT / "tests",),
        write=(tmp_path / "traces",),
    )
    inside = Child(shut, Spawner(), "render-1")
    inside.call("t", _task(tmp_path / "traces"), 30.0, Hooks())
    assert len(list(Store(inside.room.made).artifacts())) == 1
    with pytest.raises(TaskError, match="socket"):
        inside.call("t", _task(tmp_path / "traces", fault="socket"), 30.0, Hooks())
    inside.stop()


def test_a_child_whose_asker_gave_up_is_not_used_again(child: Child, tmp_path: Path) -> None:
    def give_up() -> None:
        raise KeyError

    with pytest.raises(KeyError):
        child.call("t", _task(tmp_path, sleep=30.0), 60.0, Hooks(tick=give_up))
    assert child.pid is None


def test_a_child_has_no_secret_in_its_environment_and_ends_with_its_worker(child: Child, tmp_path: Path) -> None:
    child.call("t", _task(tmp_path), 20.0, Hooks())
    pid = child.pid
    assert pid is not None
    environment = Path(f"/proc/{pid}/environ").read_bytes()
    assert b"hunter2" not in environment
    assert b"NUMBA_NUM_THREADS=1" in environment
    assert f"\0HOME={child.room.tmp}\0".encode() in environment
    channel = child._channel
    assert channel is not None
    channel.close()
    until(lambda: not alive(pid), 5.0)
