"""The child processes of a worker: one for each slot, used again, killed when their task is lost or takes too long.

A crash in a GL driver, an exhausted memory or a hang costs one task and not the worker. A child keeps its GL context
and its imports from task to task. It has no secret in its environment and ends when its worker does, however that ends.
"""

from __future__ import annotations

import os
import queue
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import structlog

from renderer.gate import RejectedScene
from schemas.problem import ExitCode, Problem
from services.engine import problems
from services.engine.channel import Channel
from services.store import MissingArtifact

READY_SECONDS = 120.0
TICK_SECONDS = 0.2
LINE_BYTES = 2000
"""Longer lines of a body's output are cut."""

_SECRET = re.compile(
    r"^(DIAPHANE_(?!STATE$)|AWS_|PG|DBOS|KUBERNETES_)|SECRET|TOKEN|PASSWORD|PASSWD|CREDENTIAL|_KEY$|_DSN$"
)

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class ChildOptions:
    """How children are set up.

    Attributes:
        make: `module:function` of tasks' bodies.
        inspect: `module:function` of checks of scenes.
        sandbox: `module:function` that shuts the process in; empty: it stays open.
        store: Local folder of the artifacts.
        read: Files and folders that may be read.
        write: Folders that may be written to.
        scratch: Folder for temporary files of children; each gets its own in it.
        threads: Threads that a body may use.
        memory_bytes: Bound of a child's memory; None: none.
        file_bytes: Bound of a file that a child writes.
    """

    make: str
    inspect: str
    sandbox: str
    store: Path
    read: tuple[Path, ...]
    write: tuple[Path, ...]
    scratch: Path
    threads: int = 1
    memory_bytes: int | None = None
    file_bytes: int = 64 << 30


class Lost(Exception):
    """The child was killed because its task is no longer this worker's."""


@dataclass
class Hooks:
    """What a call tells while it runs.

    Attributes:
        progress: Fraction done, and how it goes.
        line: A line of output.
        tick: Called several times a second.
    """

    progress: Callable[[float, str], None] = field(default=lambda fraction, note: None)
    line: Callable[[str], None] = field(default=lambda text: None)
    tick: Callable[[], None] = field(default=lambda: None)


class Spawner:
    """Starts processes from one thread that lives as long as the worker.

    The kernel ends a child when the *thread* that started it ends, not when the process does.
    """

    def __init__(self) -> None:
        self._requests: queue.SimpleQueue[tuple[Callable[[], None], threading.Event]] = queue.SimpleQueue()
        threading.Thread(target=self._run, daemon=True, name="spawner").start()

    def call(self, start: Callable[[], None]) -> None:
        """Runs `start` in that thread."""
        done, failures = threading.Event(), list[BaseException]()

        def run() -> None:
            try:
                start()
            except BaseException as error:
                failures.append(error)

        self._requests.put((run, done))
        done.wait()
        if failures:
            raise failures[0]

    def _run(self) -> None:
        while True:
            run, done = self._requests.get()
            run()
            done.set()


class Child:
    """A slot: a process that is started when it is first needed, and again after it was killed."""

    def __init__(self, options: ChildOptions, spawner: Spawner, name: str) -> None:
        self._options, self._spawner, self._name = options, spawner, name
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Channel | None = None
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._lost = False

    @property
    def pid(self) -> int | None:
        """Process id, while there is a process."""
        return None if self._process is None else self._process.pid

    def call(self, title: str, request: Mapping[str, Any], seconds: float, hooks: Hooks) -> dict[str, Any]:
        """Does one request.

        Args:
            title: The task in words, for messages.
            request: As `services.engine.child` understands it.
            seconds: Longest time.
            hooks: Told what happens.

        Returns:
            `facts` and `usage`.

        Raises:
            Problem: As the body raised it.
            MissingArtifact: As the body raised it.
            TaskError: The body raised something else, the process crashed, or it took too long.
            Lost: It was killed by `lose`.
        """
        channel = self._ready(title)
        try:
            channel.send(dict(request))
            answer = self._wait(title, channel, time.monotonic() + seconds, seconds, hooks)
        except (OSError, ValueError):
            answer = None
        except BaseException:  # whoever asked does not want the answer any more
            self.stop()
            raise
        if answer is None:
            raise self._ended(title)
        self._say(hooks)
        return self._understood(title, answer, hooks)

    def renew(self) -> None:
        """Forgets that an earlier task was lost."""
        with self._lock:
            self._lost = False

    def lose(self) -> None:
        """Kills the process: the call under way ends with `Lost`."""
        with self._lock:
            self._lost = True
            self._kill()

    def stop(self) -> None:
        """Ends the process."""
        with self._lock:
            self._kill()
        self._clear()

    def _ready(self, title: str) -> Channel:
        if self._process is not None and self._process.poll() is not None:
            self._clear()
        if self._channel is None:
            self._spawner.call(self._start)
            assert self._channel is not None
            try:
                answer = self._channel.receive(READY_SECONDS)
            except (TimeoutError, OSError, ValueError):
                answer = None
            if answer is None or answer.get("kind") != "ready":
                raise self._ended(title)
            if answer.get("missing"):
                log.warning("the sandbox is incomplete", missing=answer["missing"])
        return self._channel

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        scratch = self._options.scratch / self._name
        shutil.rmtree(scratch, ignore_errors=True)
        scratch.mkdir(parents=True)
        command = [sys.executable, "-m", "services.engine.child", str(theirs.fileno()), str(os.getpid())]
        with theirs:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(theirs.fileno(),),
                env=_environment(scratch, self._options.threads),
                start_new_session=True,
            )
        channel = Channel(ours)
        options = self._options
        folders = [*options.write, scratch]
        with suppress(OSError):  # a child that ended at once is noticed by whoever waits for it
            channel.send(
                {
                    "make": options.make,
                    "inspect": options.inspect,
                    "sandbox": options.sandbox,
                    "store": str(options.store),
                    "read": [str(path) for path in options.read],
                    "write": [str(path) for path in folders],
                    "memory_bytes": options.memory_bytes,
                    "file_bytes": options.file_bytes,
                }
            )
        with self._lock:
            self._process, self._channel = process, channel
            if self._lost:
                self._kill()
        threading.Thread(target=self._read_lines, args=(process,), daemon=True, name=f"output {self._name}").start()

    def _wait(self, title: str, channel: Channel, end: float, seconds: float, hooks: Hooks) -> dict[str, Any] | None:
        while True:
            hooks.tick()
            self._say(hooks)
            if time.monotonic() > end:
                self.stop()
                raise problems.timed_out(title, seconds)
            try:
                message = channel.receive(TICK_SECONDS)
            except TimeoutError:
                continue
            if message is None or message.get("kind") != "progress":
                return message
            hooks.progress(float(message["fraction"]), str(message["note"]))

    def _ended(self, title: str) -> Exception:
        """What it means that the process does not answer any more."""
        with self._lock:
            lost, process = self._lost, self._process
        code: int | None = None
        if process is not None:
            with suppress(subprocess.TimeoutExpired):
                code = process.wait(1.0)
        self.stop()
        return Lost(title) if lost else problems.crashed(title, code)

    def _understood(self, title: str, answer: dict[str, Any], hooks: Hooks) -> dict[str, Any]:
        kind = answer.get("kind")
        if kind == "problem":
            if answer.get("slug"):
                raise RejectedScene(answer["slug"], str(answer["title"]), str(answer["remedy"]))
            raise Problem(str(answer["title"]), str(answer["remedy"]), ExitCode(answer["code"]))
        if kind == "missing":
            raise MissingArtifact(str(answer["artifact"]))
        if kind == "done":
            return answer
        for line in str(answer.get("traceback", "")).splitlines():
            hooks.line(line)
        raise problems.failed(title, str(answer.get("summary", "")))

    def _say(self, hooks: Hooks) -> None:
        with suppress(queue.Empty):
            while True:
                hooks.line(self._lines.get_nowait())

    def _read_lines(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdout is not None
        with process.stdout as stream:
            while line := stream.readline(LINE_BYTES):
                text = line.decode(errors="replace").rstrip()
                # A body that floods its output must not fill the worker's memory.
                if text and self._lines.qsize() < 10_000:
                    self._lines.put(text)

    def _kill(self) -> None:
        if self._process is not None and self._process.poll() is None:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)

    def _clear(self) -> None:
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(5.0)
        if self._channel is not None:
            self._channel.close()
        shutil.rmtree(self._options.scratch / self._name, ignore_errors=True)
        self._process = self._channel = None


class Pool:
    """The children of one role."""

    def __init__(self, options: ChildOptions, spawner: Spawner, role: str, slots: int) -> None:
        self._children = [Child(options, spawner, f"{role}-{os.getpid()}-{index}") for index in range(slots)]
        self._free: queue.SimpleQueue[Child] = queue.SimpleQueue()
        for child in self._children:
            self._free.put(child)

    @contextmanager
    def child(self) -> Iterator[Child]:
        """A free child, the caller's own until the context is left."""
        child = self._free.get()
        child.renew()
        try:
            yield child
        finally:
            self._free.put(child)

    def stop(self) -> None:
        """Ends all processes."""
        for child in self._children:
            child.lose()
            child.stop()


def _environment(scratch: Path, threads: int) -> dict[str, str]:
    """The worker's environment without secrets, with its own folders, and with bounded thread pools."""
    kept = {name: value for name, value in os.environ.items() if not _SECRET.search(name)}
    count = str(threads)
    pools = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "LP_NUM_THREADS")
    kept |= {name: os.environ.get(name, count) for name in pools}
    kept |= {"TMPDIR": str(scratch), "XDG_CACHE_HOME": str(scratch), "MPLCONFIGDIR": str(scratch)}
    kept.setdefault("NUMBA_CACHE_DIR", str(scratch.parent / "numba"))
    return {**kept, "PYTHONUNBUFFERED": "1", "PYTHONPATH": os.pathsep.join([_ROOT, *_paths(kept)])}


def _paths(environment: Mapping[str, str]) -> list[str]:
    return [path for path in environment.get("PYTHONPATH", "").split(os.pathsep) if path]


_ROOT = str(Path(__file__).resolve().parents[2])
