"""Stand-ins for the pipeline and the stages' bodies: they sleep, crash and kill as they are told, and keep a trace."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from schemas.job import JobSpec, Priority
from schemas.problem import ExitCode, Problem
from services.runner import Runner
from stages.desk import FolderOf
from stages.store import MissingArtifact, Store
from stages.tasks import FACTS, Report, Task

PLANS = "ENGINE_PLANS"
"""Variable that names the folder of plans: NAME.json, a list of {"stage", "tasks"} or {"step"}."""


def spec(name: str, priority: Priority = "normal") -> JobSpec:
    """A job whose plan has this name."""
    return JobSpec(kind="train", name=name, dataset="dst_" + "0" * 32, priority=priority)


def run_job(spec: JobSpec, scenes: Mapping[str, Any], runner: Runner, job: Any) -> dict[str, Any]:
    """Does the plan of the spec's name; a stage's tasks need all that the stage before it made."""
    plan = json.loads((Path(os.environ[PLANS]) / f"{spec.name}.json").read_text())
    made: list[Task] = []
    names: dict[str, list[str]] = {}
    for part in plan:
        if "step" in part:
            runner.step(part["step"], lambda part=part: _append(Path(part["file"]), f"{part['step']} {job.id}"))
            continue
        needs = tuple(task.artifact for task in made)
        asked = [
            Task(
                name=params["name"], stage=part["stage"], version="1", params={**params, "plan": spec.name}, needs=needs
            )
            for params in part["tasks"]
        ]
        facts = runner.map(part["stage"], asked)
        made = [task for task, found in zip(asked, facts, strict=True) if found is not None]
        names[part["stage"]] = [task.name for task in made]
        if asked and not made:
            raise Problem(f"Nothing of {part['stage']} was made.", "Look at the tasks.", ExitCode.CHECK_FAILED)
    return {"made": names}


def make(task: Task, store: Store, folder_of: FolderOf, report: Report) -> None:
    """Makes a fake artifact."""
    params = task.params
    trace = Path(params["trace"])
    before = sum(line.split()[1] == task.name for line in _lines(trace))
    _append(trace, f"{time.time():.3f} {task.name} {os.getpid()} {os.getppid()}")
    for need in task.needs:
        store.fetch(need)
    if before < params.get("times", 1_000_000):
        if params.get("fault") == "lose-need":
            Store(trace.parent / "store").remove(task.needs[0])  # the service's, not what lies ready for this task
            raise MissingArtifact(task.needs[0])
        _FAULTS.get(params.get("fault", "none"), _FAULTS["none"])()
    end = time.monotonic() + params.get("sleep", 0.0)
    while time.monotonic() < end:
        time.sleep(0.05)
        report(1.0 - (end - time.monotonic()) / params["sleep"], "working")
    with store.put(task.address) as folder:
        (folder / FACTS).write_text(json.dumps({"name": task.name}))


def inspect(folder: Path, root: str) -> dict[str, Any]:
    """Looks into a fake scene."""
    text = (folder / root).read_text()
    if text == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    if text.startswith("slow"):
        time.sleep(600.0)
    if text == "bad":
        raise Problem("The scene is bad.", "Send a good one.")
    return {"triangles": len(text)}


def trace(path: Path) -> list[tuple[float, str, int, int]]:
    """Time, task, process and parent of every body begun."""
    parts = [line.split() for line in _lines(path)]
    return [(float(at), name, int(pid), int(parent)) for at, name, pid, parent in parts]


def _raise() -> None:
    raise ValueError("bad luck")


def _problem() -> None:
    raise Problem("The view is empty.", "Move the camera.", ExitCode.CHECK_FAILED)


def _talk() -> None:
    for number in range(5000):
        print(f"line {number}")
    print("to stderr", file=sys.stderr)


def _kill_parent() -> None:
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(30)


def _socket() -> None:
    import socket

    try:
        socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    except OSError as error:
        raise ValueError(f"socket: {error}") from error


_FAULTS: dict[str, Callable[[], None]] = {
    "none": lambda: None,
    "raise": _raise,
    "problem": _problem,
    "crash": lambda: os.kill(os.getpid(), signal.SIGSEGV),
    "kill-parent": _kill_parent,
    "talk": _talk,
    "socket": _socket,
}


def _lines(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def _append(path: Path, line: str) -> None:
    with path.open("a") as stream:
        stream.write(line + "\n")
