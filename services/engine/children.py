"""The child processes of a worker: one for each slot, used again, killed when their task is lost or takes too long.

A crash in a GL driver, an exhausted memory or a hang costs one task and not the worker. A child keeps its GL context
and its imports from task to task of the same scene; it never meets two, so that what a scene does to it reaches no
other one. It sees the files of its task (`services.engine.rooms`), has no secret in its environment, and ends when its
worker does, however that ends.
"""

from __future__ import annotations

import os
import queue
import re
import signal
import site
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
from services.engine.rooms import Room
from stages.store import MissingArtifact

READY_SECONDS = 120.0
TICK_SECONDS = 0.2
LINE_BYTES = 2000
"""Longer lines of a body's output are cut."""

_SECRET = re.compile(r"^(DIAPHANE_|AWS_|PG|DBOS|KUBERNETES_)|SECRET|TOKEN|PASSWORD|PASSWD|CREDENTIAL|_KEY$|_DSN$")
_SEARCHED = re.compile(r"^PXR_(?!WORK_THREAD_LIMIT$)|_SEARCH_PATH$")
"""Variables that name folders in which USD and MaterialX would look for what a scene names."""
_HOMES = ("HOME", "TMPDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "MPLCONFIGDIR")
"""Variables that name folders in which libraries keep what they like."""

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class ChildOptions:
    """How children are set up.

    Attributes:
        make: `module:function` of tasks' bodies.
        inspect: `module:function` of checks of scenes.
        sandbox: `module:function` that shuts the process in; empty: it stays open.
        scratch: Folder of the children's rooms.
        kernels: Folder of what numba compiled, for each key that jobs are of: what is compiled there is run.
        read: Files and folders that may be read beside the room.
        write: Folders that may be written to beside the room.
        threads: Threads that a body may use.
        memory_bytes: Bound of a child's memory; None: none.
        file_bytes: Bound of a file that a child writes.
    """

    make: str
    inspect: str
    sandbox: str
    scratch: Path
    kernels: Path
    read: tuple[Path, ...] = ()
    write: tuple[Path, ...] = ()
    threads: int = 1
    memory_bytes: int | None = None
    file_bytes: int = 64 << 30


@dataclass(frozen=True)
class Assignment:
    """What a child sees for one request.

    Attributes:
        subject: Whose data it is: a process that has met one never meets another one; None: nobody's.
        needs: Folders of artifacts by `stage/key`.
        sources: Folders of sources by digest.
        checkpoints: Folder that an interrupted training goes on from, and is kept in; None: it is no training.
        owner: Id of the key whose job it is; empty: of none.
    """

    subject: str | None = None
    needs: Mapping[str, Path] = field(default_factory=dict)
    sources: Mapping[str, Path] = field(default_factory=dict)
    checkpoints: Path | None = None
    owner: str = ""


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
        self.room = Room(options.scratch / name)
        self._assignment = Assignment()
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: Channel | None = None
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._lost = False

    @property
    def pid(self) -> int | None:
        """Process id, while there is a process."""
        return None if self._process is None else self._process.pid

    def call(
        self,
        title: str,
        request: Mapping[str, Any],
        seconds: float,
        hooks: Hooks,
        assignment: Assignment = Assignment(),
    ) -> dict[str, Any]:
        """Does one request.

        Args:
            title: The task in words, for messages.
            request: As `services.engine.child` understands it.
            seconds: Longest time.
            hooks: Told what happens.
            assignment: What it sees.

        Returns:
            `facts` and `usage`. An artifact that was made lies in the room until the next call.

        Raises:
            Problem: As the body raised it.
            MissingArtifact: As the body raised it.
            TaskError: The body raised something else, the process crashed, or it took too long.
            Lost: It was killed by `lose`.
        """
        channel = self._ready(title, assignment)
        self.room.fill(assignment.needs, assignment.sources)
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

    def _ready(self, title: str, assignment: Assignment) -> Channel:
        if self._process is not None and self._process.poll() is not None:
            self._clear()
        if self._channel is not None and not self._fits(assignment):
            self.stop()
        if self._channel is None:
            self._assignment = assignment
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
        self._assignment = assignment
        return self._channel

    def _fits(self, assignment: Assignment) -> bool:
        """Whether the process may see that too."""
        had = self._assignment
        alone = had.subject is None or had.subject == assignment.subject
        same = (had.owner, had.checkpoints) == (assignment.owner, assignment.checkpoints)
        return alone and same and self.room.is_open()

    @property
    def _kernels(self) -> Path:
        """What numba compiled for the key's tasks, and for no other's; without a key, for this process alone."""
        owner = self._assignment.owner
        return self._options.kernels / owner if owner else self.room.tmp

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        self.room.open()
        self._kernels.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-P", "-m", "services.engine.child", str(theirs.fileno()), str(os.getpid())]
        with theirs:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(theirs.fileno(),),
                env=self._environment(),
                cwd=self.room.empty,
                start_new_session=True,
            )
        channel = Channel(ours)
        options, checkpoints = self._options, self._assignment.checkpoints
        own = (*self.room.writable, self._kernels)
        writable = [*own, *options.write, *([] if checkpoints is None else [checkpoints])]
        with suppress(OSError):  # a child that ended at once is noticed by whoever waits for it
            channel.send(
                {
                    "make": options.make,
                    "inspect": options.inspect,
                    "sandbox": options.sandbox,
                    "room": str(self.room.folder),
                    "checkpoints": str(checkpoints or self.room.tmp),
                    "read": [str(path) for path in (*self.room.readable, *options.read)],
                    "write": [str(path) for path in writable],
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

    def _environment(self) -> dict[str, str]:
        """The worker's environment without secrets, with its own folders, and with bounded thread pools."""
        kept = {k: v for k, v in os.environ.items() if not _SECRET.search(k) and not _SEARCHED.search(k)}
        count = str(self._options.threads)
        pools = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "LP_NUM_THREADS")
        kept |= {name: os.environ.get(name, count) for name in pools}
        # A picture must not depend on what the worker's user has configured for drivers and libraries at home.
        kept["PYTHONUSERBASE"] = site.getuserbase()
        kept |= dict.fromkeys(_HOMES, str(self.room.tmp))
        kept["NUMBA_CACHE_DIR"] = str(self._kernels)
        return {**kept, "PYTHONUNBUFFERED": "1", "PYTHONPATH": os.pathsep.join([_ROOT, *_paths(kept)])}

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
        self.room.close()
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


def _paths(environment: Mapping[str, str]) -> list[str]:
    """Where modules are found: absolute, as the child works in another folder."""
    return [os.path.abspath(path) for path in environment.get("PYTHONPATH", "").split(os.pathsep) if path]  # noqa: PTH100


_ROOT = str(Path(__file__).resolve().parents[2])
