"""Real worker processes with fake bodies, to be killed: `python -m support.workers ROLE...` is one of them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Self, TypeVar

import sqlalchemy as sa

from schemas.job import FINAL_STATES, Priority
from schemas.service import JobRecord
from services.database import open_database
from services.database.tables import scenes
from services.engine.jobs import Jobs
from services.settings import Settings
from support import bodies

T = TypeVar("T")
ROOT = Path(__file__).resolve().parents[2]
READY = "ready"


class Fleet:
    """A service's database and store, and worker processes on it.

    Args:
        folder: For everything; empty.
        database_url: Of an empty database.
        environment: Further `DIAPHANE_*` settings of the workers.
    """

    def __init__(self, folder: Path, database_url: str, **environment: str) -> None:
        self.folder, self.trace_file = folder, folder / "trace"
        (folder / "plans").mkdir()
        variables = {"STATE": str(folder), "DATABASE": database_url, "HEARTBEAT": "0.25", "TTL": "3", "POLL": "0.05"}
        variables |= {"DRAIN_SECONDS": "5", **environment}
        self.variables = {f"DIAPHANE_{name}": value for name, value in variables.items()}
        self.settings = Settings(**{name.lower(): value for name, value in variables.items()})  # type: ignore[arg-type]
        self.database = open_database(database_url)
        self.jobs = Jobs(self.settings, self.database)
        self.workers: list[WorkerProcess] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self.workers:
            worker.kill()
        self.jobs.close()
        self.database.close()

    def worker(self, *roles: str, **variables: str) -> WorkerProcess:
        """Starts a process; `ready` waits for it."""
        worker = WorkerProcess(self, roles, variables)
        self.workers.append(worker)
        return worker

    def plan(self, name: str, *parts: dict[str, Any]) -> None:
        """Writes what a job of this name does."""
        for part in parts:
            for task in part.get("tasks", ()):
                task["trace"] = str(self.trace_file)
        (self.folder / "plans" / f"{name}.json").write_text(json.dumps(parts))

    def submit(self, name: str, *parts: dict[str, Any], priority: Priority = "normal") -> str:
        """Queues a job with this plan."""
        self.plan(name, *parts)
        return self.jobs.submit(bodies.spec(name, priority), submitted_by="key_test")[0].id

    def send(self, key: str, text: str) -> str:
        """Has a scene checked that has such a text (`bodies.inspect`); its id."""
        from services.scenes import Scenes
        from services.storage import open_storage

        blobs = open_storage(self.settings).blobs
        sent = Scenes(self.database, blobs, self.jobs)
        return sent.create("sent", "a.usda", {"a.usda": blobs.put_bytes(text.encode()).sha256}, key)[0].id

    def checked(self, scene_id: str) -> str:
        """State of a scene."""
        with self.database.read() as connection:
            return str(connection.scalar(sa.select(scenes.c.state).where(scenes.c.id == scene_id)))

    def trace(self) -> list[tuple[float, str, int, int]]:
        """See `bodies.trace`."""
        return bodies.trace(self.trace_file)

    def begun(self, name: str) -> int:
        """How often the body of a task began."""
        return sum(entry[1] == name for entry in self.trace())

    def wait(self, job_id: str, seconds: float = 30.0) -> JobRecord:
        """Waits for the end of a job."""

        def ended() -> JobRecord | None:
            job = self.jobs.get(job_id)
            return job if job.state in FINAL_STATES else None

        return until(ended, seconds, lambda: f"{self.jobs.get(job_id)}\n{self.logs()}")

    def logs(self) -> str:
        """The last that the workers wrote."""
        return "\n".join(worker.log.read_text()[-3000:] for worker in self.workers)


class WorkerProcess:
    """One process."""

    def __init__(self, fleet: Fleet, roles: Sequence[str], variables: dict[str, str]) -> None:
        self.log = fleet.folder / f"worker-{len(fleet.workers)}.log"
        own = {f"DIAPHANE_{name}": value for name, value in variables.items()}
        path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
        environment = {**os.environ, **fleet.variables, **own, "PYTHONPATH": path}
        environment[bodies.PLANS] = str(fleet.folder / "plans")
        with self.log.open("wb") as stream:
            command = [sys.executable, "-m", "support.workers", *roles]
            self.process = subprocess.Popen(
                command, stdout=stream, stderr=stream, env=environment, cwd=ROOT, start_new_session=True
            )

    @property
    def pid(self) -> int:
        """Process id."""
        return self.process.pid

    def ready(self, seconds: float = 30.0) -> Self:
        """Waits until it takes work."""

        def started() -> bool:
            assert self.process.poll() is None, self.log.read_text()
            return READY in self.log.read_text()

        until(started, seconds, self.log.read_text)
        return self

    def kill(self) -> None:
        """As the kernel does when memory is exhausted."""
        if self.process.poll() is None:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGKILL)
        self.process.wait()

    def signal(self, number: signal.Signals) -> None:
        """Sends a signal."""
        os.kill(self.process.pid, number)

    def stop(self, seconds: float = 15.0) -> int:
        """Asks it to end; its exit status."""
        self.signal(signal.SIGTERM)
        return self.process.wait(seconds)


def until(found: Callable[[], T | None], seconds: float = 30.0, why: Callable[[], str] = lambda: "") -> T:
    """Waits until `found` gives something true."""
    end = time.monotonic() + seconds
    while True:
        value = found()
        if value:
            return value
        assert time.monotonic() < end, why()
        time.sleep(0.05)


def alive(pid: int) -> bool:
    """Whether a process runs."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in ("Z", "X")


def main() -> None:
    """Runs until it is told to stop."""
    import threading

    from services.engine.runtime import Bodies, Parts, Runtime
    from services.scenes import Scenes
    from services.storage import open_storage

    settings = Settings()
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    names = Bodies("support.bodies:run_job", "support.bodies:make", "support.bodies:inspect", "", retry_seconds=0.1)
    storage, database = open_storage(settings), open_database(settings.database_url)
    sent = Scenes(database, storage.blobs, Jobs(settings, database))
    parts = Parts(storage, None, None, sent)  # type: ignore[arg-type]
    runtime = Runtime(settings, sys.argv[1:], names, parts)  # type: ignore[arg-type]
    runtime.start()
    print(READY, flush=True)
    stop.wait()
    runtime.stop()


if __name__ == "__main__":
    main()
