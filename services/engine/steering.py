"""The one function that changes DBOS from within, where it offers no public way.

What is missing, in 3.4, and why it is needed:
- a worker's own number of slots: that of `register_queue(worker_concurrency=)` lies in the database, one for all
  workers, but machines differ, and a process that is to end must claim nothing more while it finishes;
- a cheap look: an idle worker opens two transactions at every poll of every queue, 3 ms of the processor each;
- a bound on waits: after connections that failed it doubles them up to 90 s, after two claims at once up to 120 s.

`tests/integration/test_engine_contract.py` tells when a version of DBOS works otherwise; a process whose DBOS lacks one
of the names says so and ends, rather than never taking work.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable
from typing import Any, Final

from schemas.problem import ExitCode, Problem
from services.database import Database
from services.engine import system

LONGEST_WAIT_SECONDS = 2.0
"""Before DBOS asks again for a database that did not answer."""
QUEUE_SECONDS = 5.0
"""For so long a process goes by what it has read of a queue: nothing there changes while a service runs."""
NAMES: Final = ("get_queue", "dequeue_scopes", "is_lock_conflict", "is_serialization_conflict")
"""Methods of DBOS's system database that are read or replaced."""
CONCURRENCY: Final = "_worker_concurrency"
"""What a queue that was read says of the process; all queues are registered before a process is steered."""


def steer(database: Database, slots: dict[str, int]) -> None:
    """Has DBOS, in this process, claim so much of each queue at most, look cheaply, and wait no longer than it must.

    One short statement asks first whether anything waits in a queue, and DBOS claims where it does. What is read of a
    queue is kept for a while. After another worker claimed at the same moment the next poll looks again, as it does
    where a lock is held.

    Args:
        database: That the queues are in.
        slots: How much this process does of each queue at once; the dictionary may change at any time.

    Raises:
        Problem: The installed DBOS cannot be steered.
    """
    module, inner = _inner(slots)
    read, read_at, queues = inner.get_queue, dict[str, float](), dict[str, Any]()
    is_locked, is_contended, waits = inner.is_lock_conflict, inner.is_serialization_conflict, _Waits(database)

    def get_queue(name: str, **options: Any) -> Any:
        now = time.monotonic()
        if name not in queues or now - read_at[name] > QUEUE_SECONDS:
            queues[name], read_at[name] = read(name, **options), now
        queue = queues[name]
        if queue is not None:
            setattr(queue, CONCURRENCY, slots.get(name, 0))
        return queue

    def dequeue_scopes(name: str) -> list[None]:
        return [None] if waits(name) else []

    def conflicts(error: Any) -> Any:
        return is_locked(error) or is_contended(error)

    vars(inner).update(get_queue=get_queue, dequeue_scopes=dequeue_scopes, is_lock_conflict=conflicts)
    vars(module)["time"] = _ShortWaits()


def _inner(slots: Iterable[str]) -> tuple[Any, Any]:
    """The module of DBOS's system database, and the one of this process.

    Raises:
        Problem: Something in there has another name now.
    """
    try:
        import dbos._sys_db as module
        from dbos._dbos import _get_dbos_instance

        inner = _get_dbos_instance()._sys_db
        missing = [name for name in NAMES if not callable(getattr(inner, name, None))]
        missing += [] if hasattr(module, "time") else ["time"]
        if not missing and not all(hasattr(queue, CONCURRENCY) for queue in map(inner.get_queue, slots)):
            missing = [CONCURRENCY]
    except (ImportError, AttributeError) as error:
        missing = [str(error)]
    if missing:
        raise Problem(
            f"The installed version of DBOS lacks what the engine needs: {', '.join(missing)}.",
            "Install the version in requirements.lock.",
            ExitCode.CHECK_FAILED,
        )
    return module, inner


class _Waits:
    """Asks whether anything waits in a queue: by the driver, on a connection that each thread keeps."""

    def __init__(self, database: Database) -> None:
        self._database, self._own = database, threading.local()
        self._texts: dict[str, str] = {}

    def __call__(self, queue: str) -> bool:
        if not hasattr(self._own, "connection"):
            self._own.connection = self._connect()
        try:
            return bool(self._own.connection.execute(self._text(queue)).fetchall())
        except Exception:  # the server went away: the next look connects again
            self._own.connection.close()
            del self._own.connection
            raise

    def _connect(self) -> Any:
        pooled = self._database.engine.raw_connection()
        connection: Any = pooled.driver_connection
        pooled.detach()
        if self._database.is_postgresql:  # to SQLite's it is by our own setting
            connection.autocommit = True
        return connection

    def _text(self, queue: str) -> str:
        if queue not in self._texts:
            asked = system.waiting(self._database).params(queue=queue)
            options = {"literal_binds": True}
            self._texts[queue] = str(asked.compile(self._database.engine, compile_kwargs=options))
        return self._texts[queue]


class _ShortWaits:
    """The module `time` with a bound on `sleep`."""

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)

    def sleep(self, seconds: float) -> None:
        time.sleep(min(seconds, LONGEST_WAIT_SECONDS))
