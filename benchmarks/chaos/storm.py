"""SIGKILLs at random while builds run, database and store that go away, and how long each takes to be made good.

A kill is *recovered* when all that was under way in the process is under way in another one, or has ended: workflows
are claimed by others, the task of a killed child is begun again, an API server that was started again is ready. What
was killed is started again at once, as a supervisor does.

No task is hit more than twice: one whose process is killed three times is given up by design, since what it reads most
probably exhausts the machine's memory.
"""

from __future__ import annotations

import os
import random
import re
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from benchmarks.chaos import watch
from tests.support.cluster import API, Cluster, Member, children_of

MOST_HITS = 2
LONGEST_SECONDS = 180.0
"""What has not recovered after so long never does."""
PAUSE_SECONDS = 0.0, 1.0
AT_ONCE = 3
"""Kills that have not recovered; then the next one waits."""
BUSY_SECONDS = 3.0
"""How long a process that does something is looked for."""
_LOOK_SECONDS = 0.1
_CHILD = "services.engine.child"


@dataclass
class Kill:
    """A fault.

    Attributes:
        what: `api`, the roles of a worker, `child`, or what was away.
        doing: Stages of the tasks that were under way; `jobs`; `idle`.
        begun: When, by this process's clock.
        is_well: Whether all of it is made good.
        seconds: Until then; None: not yet, or there was nothing to make good.
    """

    what: str
    doing: str
    begun: float
    is_well: Callable[[], bool] = field(repr=False)
    seconds: float | None = None


class Storm:
    """Kills, starts again what was killed, and watches.

    Args:
        cluster: Whom it kills.
        seed: Of what is killed, and when.

    Attributes:
        kills: Faults, in order.
    """

    def __init__(self, cluster: Cluster, seed: int) -> None:
        self._cluster, self._random = cluster, random.Random(seed)
        self._hits: Counter[tuple[str, int]] = Counter()
        self._open: list[Kill] = []
        self._end = threading.Event()
        self._watcher = threading.Thread(target=self._watch, daemon=True, name="watcher")
        self.kills: list[Kill] = []

    def __enter__(self) -> Storm:
        self._watcher.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._watcher.join()

    @property
    def struck(self) -> int:
        """SIGKILLs so far."""
        return sum(kill.what not in ("database", "store") for kill in self.kills)

    def strike(self) -> None:
        """Kills a server, a worker or a child; mostly one that does something."""
        while len(self._open) >= AT_ONCE:
            time.sleep(_LOOK_SECONDS)
        time.sleep(self._random.uniform(*PAUSE_SECONDS))
        kind = self._random.choice([API, "jobs", "render", "label", "train", "child", "child", "child", "child"])
        end = time.monotonic() + BUSY_SECONDS
        while not self._strike(kind, idle_too=time.monotonic() > end):
            time.sleep(_LOOK_SECONDS)

    def settle(self) -> None:
        """Waits until all is made good that can be."""
        while self._open:
            time.sleep(_LOOK_SECONDS)

    def away(self, what: str, leave: Callable[[], None], come_back: Callable[[], None], seconds: float) -> None:
        """Takes the database or the store away, and kills a server and a worker meanwhile.

        All recovery counts from the return: before it nobody can do anything.

        Args:
            what: `database` or `store`.
            leave: Takes it away.
            come_back: Brings it back.
            seconds: For how long.
        """
        self.settle()
        database = self._cluster.service.database
        leave()
        time.sleep(0.5 * seconds)
        ready = [member for member in self._cluster.members if member.is_running() and member.is_ready()]
        servers = [member for member in ready if member.kind == API]
        victims = [self._random.choice(servers), self._random.choice([m for m in ready if m.kind != API])]
        for member in victims:
            member.process.kill()
        time.sleep(0.5 * seconds)
        come_back()
        moment, begun = time.time(), time.monotonic()
        self._add(Kill(what, "all", begun, lambda: self._serve() and watch.ended_since(database, moment)))
        for member in victims:
            self._add(Kill(member.kind, f"without {what}", begun, self._is_replaced(member)))
        self.settle()

    def _is_replaced(self, member: Member) -> Callable[[], bool]:
        """Tells whether a process that was killed is back, and nothing is claimed by it any more."""
        if member.kind == API:
            return lambda: _is_ready(member.slot.url)
        executor, database = _executor_of(member), self._cluster.service.database
        return lambda: not watch.claimed(database, executor)

    def _strike(self, kind: str, idle_too: bool) -> bool:
        """Kills one of a kind; whether there was one that is worth it."""
        members = [m for m in self._cluster.members if m.is_running() and m.is_ready()]
        if kind == API:
            return self._kill_api([member for member in members if member.kind == API])
        chosen = [member for member in members if _does(member, kind)]
        self._random.shuffle(chosen)
        for member in chosen:
            if kind == "child":
                if self._kill_child(member, idle_too):
                    return True
            elif self._kill_worker(member, idle_too):
                return True
        # Where nobody of the kind does anything, another kind is tried.
        return idle_too and bool(self.kills) and self._strike(API, idle_too=True)

    def _kill_api(self, members: list[Member]) -> bool:
        if not members:
            return False
        member = self._random.choice(members)
        url = member.slot.url
        member.process.kill()
        self._add(Kill(API, "serving", time.monotonic(), lambda: not self._is_same(member) and _is_ready(url)))
        return True

    def _kill_worker(self, member: Member, idle_too: bool) -> bool:
        database, executor = self._cluster.service.database, _executor_of(member)
        held, workflows = watch.running(database, executor), watch.claimed(database, executor)
        if self._is_spared(held) or not (idle_too or workflows):
            return False
        begun = time.monotonic()
        member.kill()
        workflows |= watch.claimed(database, executor)
        self._hits.update(task.place for task in held)
        doing = "idle" if not workflows else _stages(held) if held else "jobs"
        self._add(Kill(member.kind, doing, begun, lambda: watch.are_taken_over(database, workflows, executor)))
        return True

    def _kill_child(self, member: Member, idle_too: bool) -> bool:
        database, executor = self._cluster.service.database, _executor_of(member)
        held = watch.running(database, executor)
        children = [pid for pid in children_of(member.pid) if _is_body(pid)]
        if not children or self._is_spared(held) or not (held or idle_too):
            return False
        begun = time.monotonic()
        with suppress(ProcessLookupError):
            os.kill(self._random.choice(children), signal.SIGKILL)
        self._hits.update(task.place for task in held)
        self._add(Kill("child", _stages(held), begun, lambda: all(watch.is_begun_again(database, t) for t in held)))
        return True

    def _is_spared(self, held: list[watch.Held]) -> bool:
        return any(self._hits[task.place] >= MOST_HITS for task in held)

    def _is_same(self, member: Member) -> bool:
        return any(member is other for other in self._cluster.members)

    def _serve(self) -> bool:
        return all(_is_ready(member.slot.url) for member in self._cluster.members if member.kind == API)

    def _add(self, kill: Kill) -> None:
        self.kills.append(kill)
        self._open.append(kill)

    def _watch(self) -> None:
        """Starts again what has ended, and takes the time of what recovers."""
        while not self._end.wait(_LOOK_SECONDS):
            for member in list(self._cluster.members):
                if not member.is_running():
                    self._cluster.kill(member)
            for kill in list(self._open):
                passed = time.monotonic() - kill.begun
                with suppress(Exception):  # the database may be away
                    if kill.is_well():
                        kill.seconds = passed
                if kill.seconds is not None or passed > LONGEST_SECONDS:
                    self._open.remove(kill)


def _does(member: Member, kind: str) -> bool:
    """Whether a process is a worker of a role, or of any that has children."""
    roles = set() if member.kind == API else set(member.kind.split(","))
    return bool(roles - {"jobs"}) if kind == "child" else kind in roles


def _executor_of(member: Member) -> str:
    """The id that a worker says it has."""
    found = re.search(r"^worker (\S+) takes work", member.log.read_text(), re.MULTILINE)
    assert found is not None
    return found[1]


def _stages(held: list[watch.Held]) -> str:
    return " ".join(sorted({task.stage for task in held})) or "idle"


def _is_body(pid: int) -> bool:
    with suppress(OSError):
        return _CHILD.encode() in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False


def _is_ready(url: str) -> bool:
    with suppress(httpx.TransportError):
        return httpx.get(f"{url}/v1/health/ready", timeout=2.0).status_code == httpx.codes.OK
    return False
