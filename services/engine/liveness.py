"""Heartbeats, and taking over from the dead: what DBOS's open core leaves to its users.

Rules:
- an executor's id is of one process life; it has a row from before its first claim to its end, renewed by the
  database's clock;
- every process looks for the dead, and remembers nothing from one look to the next: whoever owns work and has no living
  row loses it. So a take-over that failed is simply done again;
- silence counts only to a process that was heard itself for as long: an outage of the database is nobody's death;
- on the same host a dead process is seen at once, by its pid and start time;
- what runs here and is not ours any more (cancelled, taken over) is killed; what is ours and does not run here (the
  answer to a claim was lost) goes back to the queue.
"""

from __future__ import annotations

import math
import os
import socket
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

import sqlalchemy as sa
import structlog
from sqlalchemy.exc import DBAPIError

from services.database import Database, tables
from services.database.clock import clock
from services.engine import system
from services.engine.claims import Claims
from services.settings import Settings

FORGOTTEN_SECONDS = 24 * 3600.0
ORPHAN_LOOKS = 3
ADRIFT_SECONDS = 5.0

log = structlog.get_logger(__name__)


def host() -> str:
    """What pids are counted in: the machine, and the container's own numbering."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()[:8]
        return f"{socket.gethostname()}/{boot}/{Path('/proc/self/ns/pid').readlink()}"
    except OSError:
        return socket.gethostname()


def process_start(pid: int) -> str | None:
    """When a process began, in the kernel's ticks; None if there is none, or only its remains."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
    except OSError:
        return None
    return None if fields[0] in ("Z", "X") else fields[19]


class Liveness:
    """Tells that this process lives, and sees to those that do not.

    Args:
        settings: Of the service.
        database: The database.
        claims: What runs here.
        slots: Queues of this process and what it does of each at once.
        adrift: Sees to jobs and checks that nobody does any more; called by those who conduct jobs.
    """

    def __init__(
        self,
        settings: Settings,
        database: Database,
        claims: Claims,
        slots: Mapping[str, int],
        adrift: Callable[[], None] = lambda: None,
    ) -> None:
        self.executor = f"{socket.gethostname()}-{os.getpid()}-{uuid.uuid4().hex[:8]}"
        self._settings, self._database, self._claims = settings, database, claims
        self._roles = ",".join(f"{role}:{count}" for role, count in slots.items())
        self._host = host()
        self._adrift = adrift
        self._orphans: Counter[str] = Counter()
        self._healthy_since: float | None = None
        self._looked = 0.0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="liveness")

    def start(self) -> None:
        """Begins the heartbeats; the first is written already (`beat`)."""
        self._thread.start()

    def stop(self) -> None:
        """Ends the heartbeats, gives back what is claimed, and removes the row: others need not wait."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join(10.0)

        def body(connection: sa.Connection) -> int:
            given = system.hand_back(connection, self._database, self.executor)
            connection.execute(tables.executors.delete().where(tables.executors.c.id == self.executor))
            return given

        try:
            given = self._database.retry(body, 5.0)
        except DBAPIError as error:
            log.warning("the claims could not be given back: they are taken over later", reason=str(error.orig))
            return
        if given:
            log.info("gave back claims", count=given)

    def beat(self) -> None:
        """Writes a heartbeat."""
        table, now = tables.executors, clock(self._database)
        with self._database.write() as connection:
            renewed = connection.execute(table.update().where(table.c.id == self.executor).values(last_seen=now))
            if renewed.rowcount:
                return
            values = {"id": self.executor, "host": self._host, "pid": os.getpid(), "roles": self._roles}
            started = process_start(os.getpid()) or ""
            connection.execute(table.insert().values(**values, started=started, last_seen=now))

    def look(self) -> None:
        """One round: heartbeat, own claims, the dead, jobs adrift."""
        self.beat()
        self._see_to_claims()
        now = time.monotonic()
        self._healthy_since = self._healthy_since or now
        self.reap(patient=now - self._healthy_since >= self._settings.ttl)
        if "jobs" in self._roles and now - self._looked >= ADRIFT_SECONDS:
            self._looked = now
            self._adrift()
            self._forget()

    def reap(self, *, patient: bool) -> list[str]:
        """Queues again what dead executors had claimed.

        Args:
            patient: Whether silence counts: this process was heard itself for as long.
        """
        dead = self._dead(patient=patient)
        if dead:
            log.warning("taking over from dead executors", executors=dead)
            with self._database.write() as connection:
                system.recover(connection, self._database, dead)
        return dead

    def _dead(self, *, patient: bool) -> list[str]:
        table = tables.executors
        age = (clock(self._database) - table.c.last_seen).label("age")
        with self._database.read() as connection:
            owners = system.owners(connection, self._database) - {self.executor}
            if not owners:
                return []
            rows = connection.execute(sa.select(table, age).where(table.c.id.in_(owners))).all()
        known = {row.id: row for row in rows}
        # Without a row there is no life: it is written before the first claim, and removed after the last.
        dead = [owner for owner in owners if owner not in known]
        for owner, row in known.items():
            gone = row.host == self._host and process_start(row.pid) != row.started
            if gone or (patient and row.age > self._settings.ttl):
                dead.append(owner)
        return sorted(dead)

    def _see_to_claims(self) -> None:
        held = self._claims.held()  # before the query: what begins meanwhile is not judged by it
        with self._database.read() as connection:
            owned = system.owned(connection, self._database, self.executor)
        self._claims.lose(held - owned)
        idle = owned - self._claims.held()
        self._orphans = Counter({workflow_id: self._orphans[workflow_id] + 1 for workflow_id in idle})
        # A busy machine takes its time between a claim and its run, and between the end of a run and its record.
        patience = max(ORPHAN_LOOKS, math.ceil(self._settings.ttl / self._settings.heartbeat))
        orphans = [workflow_id for workflow_id, looks in self._orphans.items() if looks >= patience]
        if orphans and not self._claims.draining.is_set():
            log.warning("claims without a run go back to the queue", workflows=orphans)
            with self._database.write() as connection:
                system.hand_back(connection, self._database, self.executor, orphans)

    def _forget(self) -> None:
        """Removes the rows of processes that have ended, once nothing is claimed by them any more."""
        table, age = tables.executors, clock(self._database) - tables.executors.c.last_seen
        with self._database.read() as connection:
            owners = system.owners(connection, self._database)
            here = connection.execute(sa.select(table).where(table.c.host == self._host)).all()
        gone = [row.id for row in here if row.id not in owners and process_start(row.pid) != row.started]
        with self._database.write() as connection:
            connection.execute(table.delete().where(table.c.id.in_(gone) | (age > FORGOTTEN_SECONDS)))

    def _run(self) -> None:
        while not self._end.wait(self._settings.heartbeat):
            try:
                self.look()
            except Exception as error:
                self._healthy_since = None
                # Not the whole text: it may name the server with its credentials.
                log.warning("heartbeat failed", reason=type(error).__name__)
