"""Where a process is: every point that it comes to is a line of the trace, and it waits there while a gate is shut.

Runs inside the service's processes. Points:

    STAGE:begin STAGE:end     in the body of a stage: before its work, and before its files become an artifact
    STAGE:kept                in the worker: it has taken the artifact over, and nobody else knows yet
    map:STAGE:begin, :end     in the process that conducts the job: around a stage
    publish:begin, :middle, :end   around a publication; in the middle its files are there and its row is not;
                              at the end it is published, and the job does not know yet
    step:NAME:end             a step of the job is remembered
    submit:begin, :end        in the API: around the transaction of a submission
"""

from __future__ import annotations

import errno
import functools
import importlib.abc
import importlib.util
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

STAGES = ("scene", "render", "label", "train", "export", "evaluate", "report")
POINTS = (
    *(
        point
        for stage in STAGES[:-1]
        for point in (f"map:{stage}:begin", f"{stage}:begin", f"{stage}:end", f"{stage}:kept", f"map:{stage}:end")
    ),
    *("publish:begin", "publish:middle", "publish:end", "step:publish:end", "step:record-measurements:end"),
    *("map:report:begin", "report:begin", "report:end", "report:kept", "map:report:end", "step:record-data-set:end"),
)
"""Those that every build comes to, in order."""
GATES, TRACE, FULL = "gates", "trace", "full"
_STAND_INS = {f"stages.making.{stage}": stage for stage in STAGES}
_POLL_SECONDS = 0.02

_folder = ""
_trace = -1


def install() -> None:
    """Puts the stand-ins and the points into this process."""
    global _folder, _trace
    _folder = os.environ["CHAOS_FOLDER"]
    # A child process may open no such file later: it is shut in.
    _trace = os.open(f"{_folder}/{TRACE}", os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o666)
    sys.meta_path.insert(0, _Finder())
    if "services.engine.child" in sys.orig_argv:
        from support.chaos import bodies

        bodies.load()


def reach(point: str, **facts: Any) -> None:
    """Tells that this process is at a point, and waits while its gate is shut."""
    line = {"at": time.time(), "point": point, "pid": os.getpid(), "parent": os.getppid(), **facts}
    os.write(_trace, (json.dumps(line) + "\n").encode())
    gate = f"{_folder}/{GATES}/{point}"
    while os.path.exists(gate):  # noqa: PTH110 (asking is all that a shut-in process may do there)
        time.sleep(_POLL_SECONDS)


class _Finder(importlib.abc.MetaPathFinder):
    """Finds the stages' stand-ins, and the modules that points are put into."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname in _STAND_INS:
            return importlib.util.spec_from_loader(fullname, _StandIn(_STAND_INS[fullname]))
        if fullname not in _CHANGES:
            return None
        spec = PathFinder.find_spec(fullname, path)
        assert spec is not None
        assert spec.loader is not None
        load, change = spec.loader.exec_module, _CHANGES[fullname]

        def execute(module: ModuleType) -> None:
            load(module)
            change(module)

        spec.loader.exec_module = execute  # type: ignore[method-assign]
        return spec


class _StandIn(importlib.abc.Loader):
    def __init__(self, stage: str) -> None:
        self._stage = stage

    def exec_module(self, module: ModuleType) -> None:
        from support.chaos import bodies

        module.make = functools.partial(bodies.make, self._stage)  # type: ignore[attr-defined]


def _around(owner: Any, name: str, point: Callable[..., str], *, begin: bool = True) -> None:
    """Puts a point before and one behind a method; `point` names them by the method's arguments."""
    original = getattr(owner, name)

    @functools.wraps(original)
    def wrapped(self: Any, *arguments: Any, **named: Any) -> Any:
        where, facts = point(*arguments), {"job": getattr(self, "job_id", None)}
        if begin:
            reach(f"{where}:begin", **facts)
        result = original(self, *arguments, **named)
        reach(f"{where}:end", **facts)
        return result

    setattr(owner, name, wrapped)


def _change_runner(module: Any) -> None:
    _around(module.DurableRunner, "map", lambda stage, *_: f"map:{stage}")
    _around(module.DurableRunner, "step", lambda name, *_: f"step:{name.replace(' ', '-')}", begin=False)


def _change_registry(module: Any) -> None:
    _around(module.Registry, "publish", lambda *_: "publish")
    digest_of = module.digest_of

    def wrapped(files: Any) -> Any:
        reach("publish:middle")
        return digest_of(files)

    module.digest_of = wrapped


def _change_jobs(module: Any) -> None:
    _around(module.Jobs, "submit", lambda *_: "submit")


def _change_store(module: Any) -> None:
    """A worker takes an artifact over; and where no small disk can be mounted, a file says that the disk is full."""
    sync_tree, adopt = module.sync_tree, module.Store.adopt

    def adopted(self: Any, folder: Any, artifact: str) -> None:
        adopt(self, folder, artifact)
        reach(f"{artifact.partition('/')[0]}:kept", artifact=artifact)

    module.Store.adopt = adopted

    def wrapped(folder: Any) -> None:
        if os.path.exists(f"{_folder}/{FULL}"):  # noqa: PTH110
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        sync_tree(folder)

    module.sync_tree = wrapped


_CHANGES: dict[str, Callable[[Any], None]] = {
    "services.engine.runner": _change_runner,
    "services.registry.registry": _change_registry,
    "services.engine.jobs": _change_jobs,
    "stages.store": _change_store,
}
