"""The process that tasks' bodies run in, one after the other: `python -m services.engine.child SOCKET PARENT`.

It talks with its worker in lines of JSON over a socket that it inherits, and dies with it. Before it meets foreign
data it shuts itself in (`services.sandbox`). Only what the body says reaches the worker: JSON, never a pickle.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from renderer.gate.problems import RejectedScene
from schemas.problem import Problem
from services.engine.channel import Channel
from services.engine.rooms import RoomStore
from services.problems import summary_of
from stages.store import MissingArtifact
from stages.tasks import Source, Task

PR_SET_PDEATHSIG = 1
_REPORT_SECONDS = 0.2
_TRACEBACK_CHARACTERS = 8000


def resolve(name: str) -> Any:
    """What `module:name` means."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)


def main() -> None:
    """Serves requests until the worker closes the socket."""
    _die_with(int(sys.argv[2]))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    channel = Channel.from_descriptor(int(sys.argv[1]))
    setup = channel.receive()
    if setup is None:
        return
    _enter(setup, channel)
    bodies = _Bodies(setup, channel)
    while (request := channel.receive()) is not None:
        channel.send(bodies.answer(request))


class _Bodies:
    def __init__(self, setup: dict[str, Any], channel: Channel) -> None:
        self._channel = channel
        self._make, self._inspect = setup["make"], setup["inspect"]
        self._store = RoomStore(Path(setup["room"]), Path(setup["checkpoints"]))
        self._sources = Path(setup["room"]) / "sources"
        self._told = 0.0

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """Does one request; what came of it."""
        before = resource.getrusage(resource.RUSAGE_SELF)
        try:
            facts: dict[str, Any] | None = None
            if "task" in request:
                self._task(request)
            else:
                facts = self._check(request)
        except Problem as problem:
            slug = problem.slug if isinstance(problem, RejectedScene) else None
            words = {"title": problem.title, "remedy": problem.remedy, "code": int(problem.code)}
            return {"kind": "problem", "slug": slug, **words}
        except MissingArtifact as missing:
            return {"kind": "missing", "artifact": missing.artifact}
        except BaseException as error:
            text = traceback.format_exc()[-_TRACEBACK_CHARACTERS:]
            return {"kind": "error", "summary": summary_of(error), "traceback": text}
        finally:
            with suppress(OSError, ValueError):
                sys.stdout.flush()
                sys.stderr.flush()
        after = resource.getrusage(resource.RUSAGE_SELF)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        usage = {"cpu_seconds": round(seconds, 3), "peak_bytes": after.ru_maxrss * 1024}
        return {"kind": "done", "facts": facts, "usage": usage}

    def _task(self, request: dict[str, Any]) -> None:
        make: Callable[..., None] = resolve(self._make)
        make(Task.model_validate(request["task"]), self._store, self._folder_of, self._report)

    def _check(self, request: dict[str, Any]) -> dict[str, Any]:
        inspect: Callable[[Path, str], dict[str, Any]] = resolve(self._inspect)
        return inspect(self._sources / request["source"], request["root"])

    def _folder_of(self, source: Source) -> Path:
        return self._sources / source.digest

    def _report(self, fraction: float, note: str) -> None:
        now = time.monotonic()
        if now - self._told >= _REPORT_SECONDS:
            self._told = now
            self._channel.send({"kind": "progress", "fraction": float(fraction), "note": str(note)[:500]})


def _enter(setup: dict[str, Any], channel: Channel) -> None:
    """Shuts the process in and says what could not be applied."""
    missing: list[str] = []
    if setup["sandbox"]:
        enter = resolve(setup["sandbox"])
        read, write = [Path(path) for path in setup["read"]], [Path(path) for path in setup["write"]]
        missing = list(enter(read, write, setup["memory_bytes"], setup["file_bytes"]).missing)
    channel.send({"kind": "ready", "missing": missing})


def _die_with(parent: int) -> None:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before we asked
        os._exit(1)


if __name__ == "__main__":
    main()
