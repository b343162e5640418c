"""A whole service: `diaphane serve` without roles, `diaphane worker` for each of them, a database and a store."""

from __future__ import annotations

import base64
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

import httpx

from schemas.job import FINAL_STATES, JobSpec
from schemas.service import JobRecord
from services.service import open_service
from services.settings import Settings
from support.chaos.disk import Disk
from support.chaos.probe import GATES, TRACE
from support.workers import ROOT, until

API = "api"
ROLES = ("jobs", "render", "label", "train")
HEARTBEAT_SECONDS, TTL_SECONDS = 0.25, 3.0
KEY_NAME = "chaos"
_INJECTED = ROOT / "tests" / "support" / "chaos" / "injected"


@dataclass
class Member:
    """A process of the service.

    Attributes:
        kind: `api`, or roles separated by commas.
        number: Which one of all.
        log: Where it writes.
        process: It.
    """

    kind: str
    number: int
    log: Path
    process: subprocess.Popen[bytes]
    stopped: bool = field(default=False)

    @property
    def pid(self) -> int:
        """Process id."""
        return self.process.pid

    @property
    def bodies(self) -> int:
        """How many bodies can run in it at once."""
        return sum(role in ROLES[1:] for role in self.kind.split(","))

    def is_running(self) -> bool:
        """Whether it lives."""
        return self.process.poll() is None

    def pause(self) -> None:
        """Stops it, until `resume`."""
        self.stopped = True
        self.process.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Lets it go on."""
        self.stopped = False
        self.process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        """As the kernel does when memory is exhausted."""
        if self.is_running():
            self.process.kill()
        self.process.wait()


class Arena:
    """The service.

    Args:
        folder: For everything; empty.
        database_url: Of an empty database.
        store_url: Of an empty object store; None: a folder that all share.
        sleep: Seconds that every body takes.
    """

    def __init__(
        self, folder: Path, database_url: str, store_url: str | None = None, *, sleep: float = 0.1, small: bool = False
    ) -> None:
        self.folder, self._trace_file = folder, folder / TRACE
        (folder / GATES).mkdir()
        self._trace_file.touch()
        self.disk = Disk(folder, small and store_url is None)
        self.port = _free_port()
        variables = {
            "DATABASE": database_url,
            "STORE": store_url or str(self.disk.path / "store"),
            "SIGNING_KEY": base64.b64encode(bytes(range(32))).decode(),
            "HEARTBEAT": str(HEARTBEAT_SECONDS),
            "TTL": str(TTL_SECONDS),
            "POLL": "0.05",
            "DRAIN_SECONDS": "2",
            "RATE": "10000",
            "BURST": "10000",
        }
        self._environment = {name: value for name, value in os.environ.items() if not name.startswith("DIAPHANE_")}
        self._environment |= {f"DIAPHANE_{name}": value for name, value in variables.items()}
        path = (_INJECTED, ROOT, ROOT / "tests")
        self._environment |= {"CHAOS_FOLDER": str(folder), "CHAOS_SLEEP": str(sleep)}
        self._environment["PYTHONPATH"] = os.pathsep.join(map(str, path))
        own = {name.lower(): value for name, value in variables.items()}
        self.service = open_service(Settings(state=folder / "client", **own))  # type: ignore[arg-type]
        self.key = self.service.keys.create(KEY_NAME, ["admin"])[1]
        self.members: list[Member] = []
        self.allowance = 0
        """Bodies that may have run in vain: those that could run in what was killed."""
        self.kills = 0
        self.mark = 0
        """Lines of the trace that came before what is being tested."""
        self._read = 0
        self._lines: list[dict[str, Any]] = []
        self._scenes = [self._scene(name) for name in ("glass", "smoke")]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for member in self.members:
            member.kill()
        self.service.jobs.close()
        self.service.database.close()
        self.disk.close()

    @property
    def url(self) -> str:
        """Where the API is."""
        return f"http://127.0.0.1:{self.port}"

    def client(self) -> httpx.Client:
        """Talks to the API."""
        return httpx.Client(base_url=self.url, headers={"Authorization": f"Bearer {self.key}"}, timeout=20.0)

    def start(self, *kinds: str, wait: bool = True) -> list[Member]:
        """Starts processes.

        Args:
            kinds: `api`, or roles separated by commas.
            wait: Until they take work.
        """
        begun = [self._start(kind) for kind in kinds]
        for member in begun if wait else ():
            self.ready(member)
        return begun

    def ready(self, member: Member, seconds: float = 60.0) -> None:
        """Waits until a process takes work."""
        sign = "Diaphane serves" if member.kind == API else "takes work:"

        def told() -> bool:
            assert member.is_running(), member.log.read_text()
            return sign in member.log.read_text()

        until(told, seconds, member.log.read_text)

    def kill(self, member: Member, *, restart: bool = True) -> None:
        """Kills a process; another one of its kind is started."""
        self.kills += 1
        self.allowance += member.bodies
        member.kill()
        self.members.remove(member)
        if restart:
            self.start(member.kind, wait=False)

    def of(self, kind: str) -> Member:
        """The oldest process of a kind."""
        return next(member for member in self.members if member.kind == kind)

    def owner(self, line: dict[str, Any]) -> Member:
        """The process that a line of the trace is of: a child's worker."""
        pids = (line["pid"], line["parent"])
        return next(member for member in self.members if member.pid in pids)

    # Gates

    def shut(self, *points: str) -> None:
        """Whoever comes to one of these points waits there."""
        for point in points:
            (self.folder / GATES / point).touch()

    def open(self, *points: str) -> None:
        """Lets them go on."""
        for point in points:
            (self.folder / GATES / point).unlink(missing_ok=True)

    def trace(self) -> list[dict[str, Any]]:
        """All points that were reached."""
        with self._trace_file.open("rb") as stream:
            stream.seek(self._read)
            new = stream.read()
        whole = new[: new.rfind(b"\n") + 1]
        self._read += len(whole)
        self._lines += map(json.loads, whole.splitlines())
        return self._lines

    def reached(self, *points: str, seconds: float = 60.0) -> dict[str, Any]:
        """Waits until a process that lives has come to one of some points since the gates were shut; its line."""

        def found() -> dict[str, Any] | None:
            lines = [line for line in self.trace()[self.mark :] if line["point"] in points]
            return next((line for line in reversed(lines) if self._lives(line)), None)

        return until(found, seconds, lambda: f"nobody came to {points}\n{self.logs()}")

    def logs(self) -> str:
        """The last that the processes wrote."""
        return "\n".join(f"--- {log.name}\n{log.read_text()[-1500:]}" for log in sorted(self.folder.glob("*.log")))

    def tidy(self, *kinds: str) -> None:
        """Makes room, opens all gates, and sees to it that just these processes run."""
        self.disk.free()
        self.open(*(path.name for path in (self.folder / GATES).iterdir()))
        missing = list(kinds)
        for member in list(self.members):
            if member.is_running() and not member.stopped and member.kind in missing:
                missing.remove(member.kind)
                continue
            member.kill()
            self.members.remove(member)
        self.start(*missing)
        self.mark = len(self.trace())

    # Jobs

    def spec(self, name: str, seed: int, views: int = 1, **more: Any) -> dict[str, Any]:
        """A build of two scenes, one of them held out."""
        first, second = self._scenes
        scenes = [{"scene": first}, {"scene": second, "holdout": True}]
        size = {"width": 32, "height": 32, "budgets": [2.0], "views_per_scene": views}
        return {"kind": "build", "name": name, "scenes": scenes, "seed": seed, **size, **more}

    def submit(self, name: str, seed: int, views: int = 1, **more: Any) -> str:
        """Queues a job, without the API."""
        spec = JobSpec.model_validate(self.spec(name, seed, views, **more))
        return self.service.jobs.submit(spec, submitted_by="key_test")[0].id

    def post(self, spec: dict[str, Any], key: str | None = None) -> httpx.Response:
        """Submits a job to the API."""
        headers = {} if key is None else {"Idempotency-Key": key}
        with self.client() as client:
            return client.post("/v1/jobs", json=spec, headers=headers)

    def job(self, job_id: str) -> JobRecord:
        """A job as it is now."""
        return self.service.jobs.get(job_id)

    def wait(self, *job_ids: str, seconds: float = 60.0) -> list[JobRecord]:
        """Waits for the end of jobs."""

        def ended() -> list[JobRecord] | None:
            found = [self.job(job_id) for job_id in job_ids]
            return found if all(job.state in FINAL_STATES for job in found) else None

        return until(ended, seconds, lambda: f"{[self.job(job_id) for job_id in job_ids]}\n{self.logs()}")

    @contextmanager
    def gates(self, *points: str) -> Iterator[None]:
        """Shuts gates, and opens them in the end whatever happens."""
        self.mark = len(self.trace())
        self.shut(*points)
        try:
            yield
        finally:
            self.open(*points)

    def _lives(self, line: dict[str, Any]) -> bool:
        running = {member.pid for member in self.members if member.is_running()}
        return bool(running & {line["pid"], line["parent"]}) and Path(f"/proc/{line['pid']}").exists()

    def _start(self, kind: str) -> Member:
        number = 1 + max((int(log.name.split("-")[0]) for log in self.folder.glob("*.log")), default=0)
        state, log = self.folder / f"{number:03d}", self.folder / f"{number:03d}-{kind}.log"
        program = [sys.executable, str(Path(sys.executable).with_name("diaphane"))]
        what = ["worker", "--roles", kind]
        if kind == API:
            state, what = self.folder / API, ["serve", "--roles", "none", "--port", str(self.port)]
        with log.open("wb") as stream:
            process = subprocess.Popen(
                [*program, *what, "--state", str(state)],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                env=self._environment,
                cwd=self.folder,
                start_new_session=True,
            )
        member = Member(kind, number, log, process)
        self.members.append(member)
        return member

    def _scene(self, name: str) -> str:
        """A scene that was checked, of a file that nobody opens."""
        reference = self.service.storage.blobs.put_bytes(f"#usda 1.0\n# {name}\n".encode())
        record, _ = self.service.scenes.create(name, f"{name}.usda", {f"{name}.usda": reference.sha256}, "key_test")
        self.service.scenes.resolve_check(record.id, {"triangles": 12})
        return record.id


def children_of(pid: int) -> list[int]:
    """Processes that a process has started."""
    found: list[int] = []
    with suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            with suppress(OSError):
                found += map(int, (task / "children").read_text().split())
    return found


def pause(member: Member, locked: Path | None) -> None:
    """Stops a process, at a moment when it does not hold the lock of a SQLite database."""
    import sqlite3

    while True:
        member.pause()
        if locked is None:
            return
        connection = sqlite3.connect(locked, timeout=1.0, isolation_level=None)
        try:
            connection.execute("BEGIN IMMEDIATE")
            connection.execute("ROLLBACK")
            return
        except sqlite3.OperationalError:
            member.resume()
            time.sleep(0.05)
        finally:
            connection.close()


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
