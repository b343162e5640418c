"""Connections: SQLite with a write-ahead log on one machine, PostgreSQL beyond; both ride out a restart.

Rules:
- every transaction is idempotent, so that it can be run again when the connection was lost before the answer came;
- a transaction that writes begins as one (`BEGIN IMMEDIATE` in SQLite): two writers wait for each other, and none
  fails half way because it read before it wrote.
"""

from __future__ import annotations

import math
import shutil
import sqlite3
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import sqlalchemy as sa
from sqlalchemy import event
from sqlalchemy.exc import DBAPIError, OperationalError

from schemas.problem import ExitCode, Problem
from services.database import tables

T = TypeVar("T")

PATIENCE_SECONDS = 60.0
START_PATIENCE_SECONDS = 15.0
_writers: defaultdict[str, threading.Lock] = defaultdict(threading.Lock)
"""SQLite lets waiting writers try again at intervals, and some starve: those of a process take turns by a lock."""
_OPTIONS = "-c statement_timeout=30000 -c idle_in_transaction_session_timeout=15000"
"""A process that is stopped in the middle of a transaction must not hold its locks for ever."""
_DISK_FULL = "53100"
_LOCK = 0x64696170  # of the migration, any number that nobody else uses


class Database:
    """The service's database.

    Args:
        url: `sqlite:///PATH` or `postgresql://...`.

    Attributes:
        waits_for_room: Whether `retry` also waits while the disk is full: who works does, who is asked says so.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self.engine = _engine(url)
        self.waits_for_room = True

    @property
    def is_postgresql(self) -> bool:
        """Whether it is PostgreSQL, not SQLite."""
        return self.engine.dialect.name == "postgresql"

    def free_bytes(self) -> float:
        """What is left of the disk that SQLite writes to; of PostgreSQL's nobody here can tell."""
        if self.is_postgresql:
            return math.inf
        return shutil.disk_usage(Path(str(self.engine.url.database)).parent).free

    @contextmanager
    def write(self) -> Iterator[sa.Connection]:
        """A transaction that writes: committed when the context is left, rolled back if it raises."""
        if self.is_postgresql:
            with self.engine.begin() as connection:
                yield connection
            return
        with _writers[self.url], self.engine.connect() as connection:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            with _commit(connection):
                yield connection

    @contextmanager
    def read(self) -> Iterator[sa.Connection]:
        """A connection for reading."""
        with self.engine.connect() as connection:
            yield connection

    def retry(self, body: Callable[[sa.Connection], T], patience: float = PATIENCE_SECONDS) -> T:
        """Runs a whole transaction, and runs it again while the database cannot be reached.

        Args:
            body: What the transaction does; idempotent.
            patience: Seconds after which the error is raised.
        """
        end, wait = time.monotonic() + patience, 0.1
        while True:
            try:
                with self.write() as connection:
                    return body(connection)
            except DBAPIError as error:
                if (
                    (is_full(error) and not self.waits_for_room)
                    or not _is_passing(error)
                    or time.monotonic() + wait > end
                ):
                    raise
                time.sleep(wait)
                wait = min(2.0, 2.0 * wait)

    def migrate(self) -> None:
        """Makes the tables that are missing.

        Raises:
            Problem: The tables are those of another version.
        """

        def make(connection: sa.Connection) -> None:
            if self.is_postgresql:
                connection.exec_driver_sql(f"select pg_advisory_xact_lock({_LOCK})")
            tables.METADATA.create_all(connection)
            found = connection.scalar(sa.select(tables.meta.c.value).where(tables.meta.c.name == "schema"))
            if found is None:
                connection.execute(tables.meta.insert().values(name="schema", value=tables.SCHEMA))
            elif found != tables.SCHEMA:
                raise Problem(
                    f"The database has tables of version {found}; this Diaphane needs {tables.SCHEMA}.",
                    "Use the matching version of Diaphane, or an empty database.",
                    ExitCode.CONFLICT,
                )

        try:
            self.retry(make, START_PATIENCE_SECONDS)
        except OperationalError as error:
            raise Problem(
                f"The database at {self.engine.url.host or self.engine.url.database} cannot be used: "
                f"{str(error.orig).splitlines()[0][:200]}.",
                "See to the server that DIAPHANE_DATABASE names, then start again.",
                ExitCode.TRY_AGAIN,
            ) from error

    def close(self) -> None:
        """Closes all connections."""
        self.engine.dispose()


def open_database(url: str) -> Database:
    """Opens a database and makes the tables that are missing.

    Raises:
        Problem: The URL is not understood, or the tables are those of another version.
    """
    database = Database(url)
    database.migrate()
    return database


def is_full(error: DBAPIError) -> bool:
    """Whether the database has no room left to write to."""
    if getattr(error.orig, "sqlstate", None) == _DISK_FULL:
        return True
    return getattr(error.orig, "sqlite_errorcode", None) == sqlite3.SQLITE_FULL


def _engine(url: str) -> sa.Engine:
    if url.startswith("sqlite:///"):
        # Scenes and hashes of keys are nobody else's business; a folder that exists keeps its rights.
        Path(url.removeprefix("sqlite:///")).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        engine = sa.create_engine(
            url,
            hide_parameters=True,
            # More in all than the API has threads: none waits for a connection. Those used last are used again first.
            pool_size=16,
            max_overflow=48,
            pool_use_lifo=True,
            connect_args={"timeout": 30.0, "isolation_level": None},
        )
        event.listen(engine, "connect", _set_up_sqlite)
        return engine
    if url.startswith(("postgresql://", "postgres://")):
        return sa.create_engine(
            "postgresql+psycopg://" + url.partition("://")[2],
            hide_parameters=True,  # what is written is nobody's business in a log
            pool_size=8,
            max_overflow=24,
            pool_pre_ping=True,
            connect_args={"connect_timeout": 5, "options": _OPTIONS},
        )
    scheme = url.partition(":")[0]
    raise Problem(
        f"A database URL that begins with '{scheme}:' is not understood.",
        "Set DIAPHANE_DATABASE to sqlite:///PATH or postgresql://USER:PASSWORD@HOST/NAME.",
    )


def _set_up_sqlite(connection: Any, _record: Any) -> None:
    cursor = connection.cursor()
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=NORMAL")
    cursor.execute("PRAGMA foreign_keys=ON")
    cursor.close()


@contextmanager
def _commit(connection: sa.Connection) -> Iterator[None]:
    """The driver begins no transaction of its own, so ours is ended by hand."""
    try:
        yield
    except BaseException:
        driver = connection.connection.driver_connection
        if driver is not None and driver.in_transaction:  # a disk that is full ends it by itself
            connection.exec_driver_sql("ROLLBACK")
        raise
    connection.exec_driver_sql("COMMIT")


def _is_passing(error: DBAPIError) -> bool:
    """Whether the fault lies with the connection or a lock, and not with the statement."""
    return error.connection_invalidated or isinstance(error, OperationalError)
