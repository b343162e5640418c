"""A service of real processes: API servers, workers of each role, and the database and store that they share."""

from __future__ import annotations

import base64
import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import httpx

from services.service import open_service
from services.settings import Settings

API = "api"
ROLES = ("jobs", "render", "label", "train")
ROOT = Path(__file__).resolve().parents[2]
KEY_NAME = "cluster"
END_SECONDS = 60.0
LOG_CHARACTERS = 1500
"""Of a process's log that a failure shows."""


@dataclass(frozen=True)
class Slot:
    """A place for a process, as a container is one for the processes that a supervisor starts in it one after another.

    Attributes:
        kind: `api`, or roles separated by commas.
        name: Of all slots' names its own.
        state: Name of its state folder.
        port: Of an API server.
    """

    kind: str
    name: str
    state: str
    port: int = 0

    @property
    def url(self) -> str:
        """Where the API server is."""
        return f"http://127.0.0.1:{self.port}"


@dataclass
class Member:
    """A process of the service.

    Attributes:
        slot: Where it runs.
        log: Where it writes.
        process: It.
    """

    slot: Slot
    log: Path
    process: subprocess.Popen[bytes]
    stopped: bool = field(default=False)

    @property
    def kind(self) -> str:
        """`api`, or roles separated by commas."""
        return self.slot.kind

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

    def is_ready(self) -> bool:
        """Whether it takes work."""
        return ("Diaphane serves" if self.kind == API else "takes work:") in self.log.read_text()

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


class Cluster:
    """The processes.

    Args:
        folder: For everything; empty.
        variables: Settings of all processes, without `DIAPHANE_`; the database's and the store's at least.
        environment: Other variables of all processes.
        machines: How many state folders they share; 0: each has its own.

    Attributes:
        service: The same database and store, to look into.
        key: Secret of a key that may do everything.
        key_id: Its id.
        members: The processes that run.
    """

    def __init__(
        self, folder: Path, variables: Mapping[str, str], environment: Mapping[str, str] = {}, machines: int = 0
    ) -> None:
        self.folder, self._machines = folder, machines
        given = {"SIGNING_KEY": base64.b64encode(bytes(range(32))).decode(), **variables}
        self._environment = {name: value for name, value in os.environ.items() if not name.startswith("DIAPHANE_")}
        self._environment |= {f"DIAPHANE_{name}": value for name, value in given.items()}
        self._environment |= {"PYTHONPATH": str(ROOT), **environment}
        own = {name.lower(): value for name, value in given.items()}
        self.service = open_service(Settings(state=folder / "client", **own))
        record, self.key = self.service.keys.create(KEY_NAME, ["admin"])
        self.key_id = record.id
        self.members: list[Member] = []
        self._slots: Counter[str] = Counter()
        self._begun = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for member in self.members:
            member.kill()
        self.service.jobs.close()
        self.service.database.close()

    @property
    def url(self) -> str:
        """Where the first API server is."""
        return self.of(API).slot.url

    def client(self, url: str = "") -> httpx.Client:
        """Talks to an API server, or to the first one, as the owner of `key`."""
        return httpx.Client(base_url=url or self.url, headers={"Authorization": f"Bearer {self.key}"}, timeout=20.0)

    @property
    def kernels(self) -> list[Path]:
        """Where what numba compiles for the tasks of `key` lies on each machine."""
        states = [f"machine-{number + 1}" for number in range(self._machines)]
        return [self.folder / state / "work" / "kernels" / self.key_id for state in states]

    def start(self, *kinds: str, wait: bool = True) -> list[Member]:
        """Starts processes, each in a slot of its own.

        Args:
            kinds: `api`, or roles separated by commas.
            wait: Until they take work.
        """
        begun = [self.begin(self._slot(kind)) for kind in kinds]
        for member in begun if wait else ():
            self.ready(member)
        return begun

    def begin(self, slot: Slot) -> Member:
        """Starts a process in a slot, whose last one has ended."""
        self._begun += 1
        log = self.folder / f"{self._begun:03d}-{slot.name}.log"
        program = [sys.executable, "-m", "diaphane"]
        what = ["worker", "--roles", slot.kind]
        if slot.kind == API:
            what = ["serve", "--roles", "none", "--port", str(slot.port)]
        with log.open("wb") as stream:
            process = subprocess.Popen(
                [*program, *what, "--state", str(self.folder / slot.state)],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                env=self._environment,
                cwd=self.folder,
                start_new_session=True,
            )
        member = Member(slot, log, process)
        self.members.append(member)
        return member

    def ready(self, member: Member, seconds: float = 60.0) -> None:
        """Waits until a process takes work."""
        end = time.monotonic() + seconds
        while not member.is_ready():
            assert member.is_running(), member.log.read_text()
            assert time.monotonic() < end, member.log.read_text()
            time.sleep(0.05)

    def kill(self, member: Member, *, restart: bool = True) -> None:
        """Kills a process; another one is started in its slot."""
        member.kill()
        self.members.remove(member)
        if restart:
            self.begin(member.slot)

    def end(self, *members: Member) -> None:
        """Asks processes to end, as a supervisor does, and waits until they have."""
        for member in members:
            member.process.terminate()
        for member in members:
            status = member.process.wait(END_SECONDS)
            assert status == 0, f"{member.slot.name} ended with {status}\n{member.log.read_text()}"

    def restart(self, *members: Member) -> None:
        """Asks processes to end, and starts others in their slots once all have."""
        self.end(*members)
        for member in members:
            self.members.remove(member)
        for begun in [self.begin(member.slot) for member in members]:
            self.ready(begun)

    def of(self, kind: str) -> Member:
        """The oldest process of a kind."""
        return next(member for member in self.members if member.kind == kind)

    def logs(self) -> str:
        """The last that the processes wrote."""
        found = sorted(self.folder.glob("*.log"))
        return "\n".join(f"--- {log.name}\n{log.read_text()[-LOG_CHARACTERS:]}" for log in found)

    def _slot(self, kind: str) -> Slot:
        self._slots[kind] += 1
        number = self._slots[kind]
        state = f"machine-{number % self._machines + 1}" if self._machines else f"{kind}-{number}"
        return Slot(kind, f"{kind}-{number}", state, free_port() if kind == API else 0)


def children_of(pid: int) -> list[int]:
    """Processes that a process has started."""
    found: list[int] = []
    with suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            with suppress(OSError):
                found += map(int, (task / "children").read_text().split())
    return found


def free_port() -> int:
    """A port of the loopback interface that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
