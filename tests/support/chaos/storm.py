"""Random kills of every kind of process while jobs keep coming; how long each takes to be made good."""

from __future__ import annotations

import os
import random
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import httpx

from schemas.job import FINAL_STATES
from support.chaos.arena import API, TTL_SECONDS, Arena, Member, pause
from support.chaos.probe import POINTS
from support.postgres import Postgres
from support.workers import alive

JOBS_AT_ONCE = 3
NAMES = ("glass", "smoke", "water")
AT_A_POINT, AT_WORK = 0.5, 0.9
"""Shares of the kills: at a chosen point, and of the others those of a process that does something."""
POINTS_AT_ONCE = 4
PATIENCE_SECONDS = 8.0
LONGEST_SECONDS = 90.0
"""What has not recovered after so long never does."""
_LOOK_SECONDS = 0.05


@dataclass
class Kill:
    """One fault.

    Attributes:
        what: The kind of process, `child`, `stop` or `postgresql`.
        doing: What it was doing: points that it was last at, or `idle`.
        seconds: Until all that it was doing was being done again, or was done; None if it did nothing.
    """

    what: str
    doing: str
    seconds: float | None = None


@dataclass
class Storm:
    """Figures of a run.

    Attributes:
        kills: In order.
        submitted: Ids of jobs.
        repeated: Requests to the API that had to be repeated.
    """

    kills: list[Kill] = field(default_factory=list)
    submitted: list[str] = field(default_factory=list)
    repeated: int = 0


class Thrower:
    """Kills, and keeps jobs coming.

    Args:
        arena: The service, its processes started.
        seed: Of what is killed and when.
        postgres: Is restarted now and then; None: SQLite.
    """

    def __init__(self, arena: Arena, seed: int, postgres: Postgres | None) -> None:
        self._arena, self._postgres = arena, postgres
        self._random = random.Random(seed)
        self._locked = None if postgres else arena.folder / "chaos.sqlite"
        self._stop = threading.Event()
        self._points = [point for _ in range(20) for point in self._random.sample(POINTS, len(POINTS))]
        self.storm = Storm()

    def run(self, kills: int, seconds: float) -> Storm:
        """Kills so often, or for so long; then waits for all jobs to end."""
        end = time.monotonic() + seconds
        feeder = threading.Thread(target=self._feed)
        feeder.start()
        try:
            while len(self.storm.kills) < kills and time.monotonic() < end:
                time.sleep(self._random.uniform(0.0, 0.4))
                self._strike()
        finally:
            self._stop.set()
            feeder.join()
        self._arena.wait(*self.storm.submitted, seconds=180.0)
        return self.storm

    # Jobs

    def _feed(self) -> None:
        open_jobs: set[str] = set()
        while not self._stop.is_set():
            with suppress(Exception):  # the database may be away
                open_jobs = {job for job in open_jobs if self._arena.job(job).state not in FINAL_STATES}
            if len(open_jobs) < JOBS_AT_ONCE:
                open_jobs.add(self._submit(len(self.storm.submitted)))
            time.sleep(_LOOK_SECONDS)

    def _submit(self, number: int) -> str:
        """Submits until an answer comes, as clients do."""
        start = "champion" if number % 2 else "scratch"
        # Better and worse ones in turn, so that the champion changes now and then; no two alike.
        seed = (number * 7919) % 10_007
        spec = self._arena.spec(NAMES[number % len(NAMES)], seed, views=2, start_from=start)
        while True:
            try:
                answer = self._arena.post(spec, f"storm-{number}")
                if answer.status_code in (200, 202):
                    self.storm.submitted.append(str(answer.json()["id"]))
                    return self.storm.submitted[-1]
                assert answer.status_code in (429, 500, 503), answer.text
            except httpx.TransportError:
                pass
            self.storm.repeated += 1
            time.sleep(0.1)

    # Faults

    def _strike(self) -> None:
        kinds = [API, *("jobs", "render", "label", "train", "child") * 3, "stop"]
        if self._postgres is not None and self._random.random() < 0.04:
            self._restart_database()
            return
        if self._random.random() < AT_A_POINT:
            self._kill_at_a_point()
            return
        what = self._random.choice(kinds)
        if what == "child":
            self._kill_child()
        elif what == "stop":
            self._stop_worker()
        else:
            self._kill_member(what)

    def _kill_member(self, kind: str) -> None:
        member = self._choose(kind)
        if member is None:
            return
        mark, begun = len(self._arena.trace()), time.monotonic()
        self._arena.kill(member)
        if kind == API:
            self._note(Kill(API, "serving"), begun, self._answers)
            return
        doing = self._doing(member, self._arena.trace())
        kill = Kill(kind, " ".join(sorted(doing.values())) or "idle")
        if not doing:
            self.storm.kills.append(kill)
            return
        self._note(kill, begun, lambda: self._goes_on(member, doing, mark))

    def _kill_at_a_point(self) -> None:
        """Kills whoever comes first to one of the next points, while it is there."""
        points = self._points[:POINTS_AT_ONCE]
        with self._arena.gates(*points), suppress(AssertionError):
            line = self._arena.reached(*points, seconds=PATIENCE_SECONDS)
            point, member = str(line["point"]), self._arena.owner(line)
            self._points.remove(point)
            mark, begun = len(self._arena.trace()), time.monotonic()
            self._arena.kill(member)
            self._arena.open(*points)
            doing = self._doing(member, self._arena.trace())
            if not doing:  # its work is there, and nobody has been told: then somebody goes on with the next
                self._note(Kill(member.kind, point), begun, lambda: len(self._arena.trace()) > mark)
                return
            self._note(Kill(member.kind, point), begun, lambda: self._goes_on(member, doing, mark))

    def _kill_child(self) -> None:
        """Kills a process that a body runs in, and leaves its worker alive."""
        running = _running(self._arena.trace())
        running = {artifact: line for artifact, line in running.items() if alive(line["pid"])}
        if not running:
            return
        artifact = self._random.choice(sorted(running))
        line = running[artifact]
        mark, begun = len(self._arena.trace()), time.monotonic()
        with suppress(ProcessLookupError):
            os.kill(line["pid"], signal.SIGKILL)
        self._arena.kills += 1
        self._arena.allowance += 1
        kill = Kill("child", line["point"])
        self._note(kill, begun, lambda: self._is_done_again({artifact}, mark, {line["pid"]}))

    def _stop_worker(self) -> None:
        """Stops a worker with its child for longer than the TTL; what it does afterwards is too late."""
        member = self._choose(self._random.choice(("jobs", "render", "label")))
        if member is None or len([m for m in self._arena.members if m.kind == member.kind]) < 2:
            return
        pause(member, self._locked)
        trace = self._arena.trace()
        doing, mark, begun = self._doing(member, trace), len(trace), time.monotonic()
        children = {line["pid"] for line in _running(trace).values() if line["parent"] == member.pid}
        for child in children:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGSTOP)
        self._arena.kills += 1
        self._arena.allowance += member.bodies
        kill = Kill(f"stop {member.kind}", " ".join(sorted(doing.values())) or "idle")
        if doing:
            self._note(kill, begun, lambda: self._goes_on(member, doing, mark))
        else:
            time.sleep(TTL_SECONDS + 0.5)
            self.storm.kills.append(kill)
        for child in children:
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGCONT)
        member.resume()

    def _restart_database(self) -> None:
        assert self._postgres is not None
        mark = len(self._arena.trace())
        self._arena.kills += 1
        self._arena.allowance += sum(member.bodies for member in self._arena.members)
        self._postgres.stop("immediate")
        time.sleep(self._random.uniform(0.0, 1.0))
        begun = time.monotonic()
        self._postgres.start()
        self._note(Kill("postgresql", "serving"), begun, lambda: len(self._arena.trace()) > mark + 3)

    # What came of it

    def _note(self, kill: Kill, begun: float, is_well: Callable[[], bool]) -> None:
        """Waits until all is well again; a fault that is not made good stays without a time, and that is a failure."""
        while time.monotonic() - begun < LONGEST_SECONDS:
            if is_well():
                kill.seconds = round(time.monotonic() - begun, 3)
                break
            time.sleep(_LOOK_SECONDS)
        else:
            kill.seconds = float("inf")
        self.storm.kills.append(kill)

    def _choose(self, kind: str) -> Member | None:
        """A process of a kind; mostly one that does something, as soon as there is one."""
        members = [member for member in self._arena.members if member.kind == kind and member.is_running()]
        end = time.monotonic() + PATIENCE_SECONDS * (kind != API and self._random.random() < AT_WORK)
        while time.monotonic() < end:
            trace = self._arena.trace()
            busy = [member for member in members if self._doing(member, trace)]
            if busy:
                return self._random.choice(busy)
            time.sleep(_LOOK_SECONDS)
        return self._random.choice(members) if members else None

    def _doing(self, member: Member, trace: list[dict[str, Any]]) -> dict[str, str]:
        """Artifacts that are being made in a process, or jobs that it conducts, each with the last point."""
        if member.kind != "jobs":
            lines = _running(trace)
            return {key: line["point"] for key, line in lines.items() if line["parent"] == member.pid}
        last = {line["job"]: line for line in trace if line.get("job")}
        ended = ("keep-report:end", "step:record-data-set:end")
        return {
            job: line["point"]
            for job, line in last.items()
            if line["pid"] == member.pid and not line["point"].endswith(ended)
        }

    def _goes_on(self, member: Member, doing: dict[str, str], mark: int) -> bool:
        if member.kind != "jobs":
            return self._is_done_again(set(doing), mark, {member.pid})
        later = [line for line in self._arena.trace()[mark:] if line["pid"] != member.pid]
        seen = {line.get("job") for line in later}
        return all(job in seen or self._has_ended(job) for job in doing)

    def _is_done_again(self, artifacts: set[str], mark: int, former: set[int]) -> bool:
        later = [line for line in self._arena.trace()[mark:] if not former & {line["pid"], line["parent"]}]
        seen = {line.get("artifact") for line in later}
        missing = artifacts - seen
        return not missing or all(self._arena.service.storage.store.holds(artifact) for artifact in missing)

    def _has_ended(self, job_id: str) -> bool:
        with suppress(Exception):
            return self._arena.job(job_id).state in FINAL_STATES
        return False

    def _answers(self) -> bool:
        with suppress(httpx.TransportError), self._arena.client() as client:
            return client.get("/v1/health/ready", timeout=1.0).status_code == 200
        return False


def _running(trace: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Last line of every artifact that is being made, by artifact."""
    last = {line["artifact"]: line for line in trace if "artifact" in line}
    return {artifact: line for artifact, line in last.items() if not line["point"].endswith(":kept")}


def quantile(values: list[float], share: float) -> float:
    """The smallest of the values that at least this share of them do not exceed."""
    ordered = sorted(values)
    return ordered[max(0, -(-len(ordered) * int(100 * share) // 100) - 1)]


def recovery(kills: list[Kill]) -> dict[str, dict[str, float]]:
    """How long it took, by what was hit, seconds."""
    groups: dict[str, list[float]] = {"all": [kill.seconds for kill in kills if kill.seconds is not None]}
    for what in sorted({kill.what for kill in kills}):
        groups[what] = [kill.seconds for kill in kills if kill.what == what and kill.seconds is not None]
    return {
        what: {
            "count": len(values),
            "p50": quantile(values, 0.5),
            "p95": quantile(values, 0.95),
            "max": max(values),
        }
        for what, values in groups.items()
        if values
    }


def counts(kills: list[Kill]) -> dict[str, int]:
    """How often what was hit."""
    return dict(sorted(Counter(kill.what for kill in kills).items()))
