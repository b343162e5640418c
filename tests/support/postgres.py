"""A throw-away PostgreSQL server of a test's own, on a socket and a free port of the loopback interface."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
import uuid
from pathlib import Path

import psycopg

from services.database import open_database
from services.engine import system

USER = "postgres"


def postgres_folder() -> Path | None:
    """Where `initdb` and `postgres` lie; None where there is no server."""
    found = shutil.which("initdb")
    folders = [Path(found).resolve().parent] if found else []
    folders += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    return next((folder for folder in folders if (folder / "initdb").exists()), None)


class Postgres:
    """A server with a data folder; it can be killed and started again on the same data."""

    def __init__(self, folder: Path) -> None:
        binaries = postgres_folder()
        assert binaries is not None, "PostgreSQL is missing: apt-get install postgresql"
        self._binaries, self.folder = binaries, folder
        self.port = _free_port()
        folder.mkdir(parents=True)
        if os.getuid() == 0:  # the server refuses to run as root
            shutil.chown(folder, USER)
            for parent in folder.parents:
                if not parent.stat().st_mode & 0o001:
                    parent.chmod(parent.stat().st_mode | 0o011)
        self._run("initdb", "-D", str(folder / "data"), "-U", USER, "-A", "trust", "--no-sync", "-E", "UTF8")
        self._process: subprocess.Popen[bytes] | None = None
        self._made: str | None = None
        self.start()

    def start(self) -> None:
        options = ["-D", str(self.folder / "data"), "-p", str(self.port), "-h", "127.0.0.1", "-k", str(self.folder)]
        options += ["-c", "max_connections=200", "-c", "fsync=off"]
        log = (self.folder.parent / f"{self.folder.name}.log").open("ab")
        command = self._command("postgres", *options)
        self._process = subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True)
        end = time.monotonic() + 60.0
        while True:
            try:
                psycopg.connect(self._url("postgres"), connect_timeout=2).close()
                return
            except psycopg.OperationalError:
                assert time.monotonic() < end, "PostgreSQL does not start"
                assert self._process.poll() is None, "PostgreSQL ended at once"
                time.sleep(0.1)

    def stop(self, mode: str = "fast") -> None:
        """`mode`: smart, fast or immediate (as a crash)."""
        self._run("pg_ctl", "-D", str(self.folder / "data"), "-m", mode, "-w", "stop")
        assert self._process is not None
        self._process.wait(60)

    def empty_database(self) -> str:
        """URL of a database with nothing in it."""
        return self._url(self._create("template1"))

    def new_database(self) -> str:
        """URL of a database with all tables and no job, scene or key: a copy, for making the tables takes seconds."""
        if self._made is None:
            made = self._create("template1")
            database = open_database(self._url(made))
            system.migrate(database)
            database.close()
            self._made = made
        return self._url(self._create(self._made))

    def _create(self, template: str) -> str:
        name = f"t{uuid.uuid4().hex[:12]}"
        with psycopg.connect(self._url("postgres"), autocommit=True) as connection:
            connection.execute(f"create database {name} template {template}")
        return name

    def _url(self, name: str) -> str:
        return f"postgresql://{USER}@127.0.0.1:{self.port}/{name}"

    def _command(self, program: str, *arguments: str) -> list[str]:
        command = [str(self._binaries / program), *arguments]
        as_user = ["setpriv", f"--reuid={USER}", f"--regid={USER}", "--clear-groups"] if os.getuid() == 0 else []
        return [*as_user, *command]

    def _run(self, program: str, *arguments: str) -> None:
        subprocess.run(self._command(program, *arguments), check=True, capture_output=True, timeout=120)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
