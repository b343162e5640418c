"""A whole service: `diaphane serve` without roles, `diaphane worker` for each of them, a database and a store."""

from __future__ import annotations

import json
import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from schemas.job import FINAL_STATES, JobSpec
from schemas.service import JobRecord
from support.chaos.disk import Disk
from support.chaos.probe import GATES, TRACE
from support.cluster import API, ROOT, Cluster, Member, Slot, free_port
from support.workers import until

HEARTBEAT_SECONDS, TTL_SECONDS = 0.25, 3.0
_INJECTED = ROOT / "tests" / "support" / "chaos" / "injected"


class Arena(Cluster):
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
        self._trace_file = folder / TRACE
        (folder / GATES).mkdir()
        self._trace_file.touch()
        self.disk = Disk(folder, small and store_url is None)
        self.port = free_port()
        variables = {
            "DATABASE": database_url,
            "STORE": store_url or str(self.disk.path / "store"),
            "HEARTBEAT": str(HEARTBEAT_SECONDS),
            "TTL": str(TTL_SECONDS),
            "POLL": "0.05",
            "DRAIN_SECONDS": "2",
            "RATE": "10000",
            "BURST": "10000",
        }
        path = os.pathsep.join(map(str, (_INJECTED, ROOT, ROOT / "tests")))
        super().__init__(
            folder, variables, {"CHAOS_FOLDER": str(folder), "CHAOS_SLEEP": str(sleep), "PYTHONPATH": path}
        )
        self.allowance = 0
        """Bodies that may have run in vain: those that could run in what was killed."""
        self.mark = 0
        """Lines of the trace that came before what is being tested."""
        self._read = 0
        self._lines: list[dict[str, Any]] = []
        self._scenes = [self._scene(name) for name in ("glass", "smoke")]

    def __exit__(self, *_: object) -> None:
        super().__exit__()
        self.disk.close()

    @property
    def url(self) -> str:
        """Where the API is."""
        return f"http://127.0.0.1:{self.port}"

    def kill(self, member: Member, *, restart: bool = True) -> None:
        """Kills a process; another one of its kind is started, a worker with another disk."""
        self.allowance += member.bodies
        super().kill(member, restart=restart and member.kind == API)
        if restart and member.kind != API:
            self.start(member.kind, wait=False)

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
        size = {"width": 32, "height": 32, "budgets": [0.25], "views_per_scene": views}
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

    def _slot(self, kind: str) -> Slot:
        is_first = kind == API and all(member.slot.port != self.port for member in self.members)
        return Slot(API, API, API, self.port) if is_first else super()._slot(kind)

    def _scene(self, name: str) -> str:
        """A scene that was checked, of a file that nobody opens."""
        reference = self.service.storage.blobs.put_bytes(f"#usda 1.0\n# {name}\n".encode())
        record, _ = self.service.scenes.create(name, f"{name}.usda", {f"{name}.usda": reference.sha256}, "key_test")
        self.service.scenes.resolve_check(record.id, {"triangles": 12})
        return record.id


def pause(member: Member, locked: Path | None) -> None:
    """Stops a process, at a moment when it does not hold the lock of a SQLite database."""
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
