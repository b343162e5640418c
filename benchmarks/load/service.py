"""A `diaphane serve` of its own, and what it costs: memory, processor time, files."""

from __future__ import annotations

import http.client
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Self

from benchmarks.load.http import HOST

START = "import sys; sys.argv[0] = 'diaphane'; from diaphane.cli import main; main()"
SAMPLE_SECONDS = 0.5
UNLIMITED = {"DIAPHANE_RATE": "1000000", "DIAPHANE_BURST": "1000000"}
"""Environment of a service whose load comes from one key."""
_STOP_SECONDS = 40.0
_TICKS = os.sysconf("SC_CLK_TCK")


class Service:
    """`diaphane serve` on a free port of the loopback interface.

    Args:
        state: Its state folder.
        roles: As `--roles` has it.
        environment: Further variables: `DIAPHANE_*`.
        python: Options of the interpreter.
    """

    def __init__(
        self,
        state: Path,
        roles: str = "none",
        environment: Mapping[str, str] | None = None,
        python: Sequence[str] = (),
    ) -> None:
        self.state, self.port = state, free_port()
        self.log = state.parent / f"{state.name}.log"
        command = [sys.executable, *python, "-c", START, "serve", "--port", str(self.port)]
        command += ["--state", str(state), "--roles", roles]
        kept = {name: value for name, value in os.environ.items() if not name.startswith("DIAPHANE_")}
        self._begun = time.perf_counter()
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                command, stdout=log, stderr=log, env={**kept, **(environment or {})}, start_new_session=True
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def wait_ready(self, seconds: float = 60.0) -> float:
        """Waits for the first 200 of `/v1/health/ready`; seconds since the start of the process.

        Raises:
            RuntimeError: It ended, or took too long.
        """
        while time.perf_counter() - self._begun < seconds:
            if self.process.poll() is not None:
                raise RuntimeError(f"the service ended: {self.log.read_text()[-2000:]}")
            try:
                connection = http.client.HTTPConnection(HOST, self.port, timeout=5.0)
                connection.request("GET", "/v1/health/ready")
                if connection.getresponse().status == 200:
                    return time.perf_counter() - self._begun
            except OSError:
                time.sleep(0.01)
            finally:
                connection.close()
        raise RuntimeError(f"the service was not ready after {seconds} s")

    def stop(self) -> None:
        """Ends it, as Ctrl-C does; kills it if it does not end."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(_STOP_SECONDS)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def unexpected(self) -> list[str]:
        """Lines of its log that tell of errors and warnings, without the access log."""
        lines = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        return [line for line in lines if '"level": "error"' in line or '"level": "warning"' in line]


class Sampler(threading.Thread):
    """Looks at a process and its children twice a second until it is told to stop.

    Attributes:
        samples: Seconds since the beginning, and resident bytes of the process and of its children.
    """

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.samples: list[tuple[float, int, int]] = []
        self._pid, self._end, self._cpu = pid, threading.Event(), cpu_seconds(pid)
        self._begun = time.perf_counter()

    def run(self) -> None:
        """Samples."""
        while not self._end.wait(SAMPLE_SECONDS):
            now = time.perf_counter() - self._begun
            self.samples.append((now, resident_bytes(self._pid), sum(map(resident_bytes, children(self._pid)))))

    def finish(self) -> dict[str, float]:
        """Ends; the figures, in MiB, MiB a minute over the second half, and processor seconds a second."""
        self._end.set()
        self.join()
        seconds = time.perf_counter() - self._begun
        own = [(at, size / 2**20) for at, size, _ in self.samples]
        return {
            "rss_first_mib": round(own[0][1], 1),
            "rss_max_mib": round(max(size for _, size in own), 1),
            "rss_last_mib": round(own[-1][1], 1),
            "rss_slope_mib_per_minute": round(60.0 * slope(own[len(own) // 2 :]), 2),
            "children_rss_max_mib": round(max(size for _, _, size in self.samples) / 2**20, 1),
            "cpu": round((cpu_seconds(self._pid) - self._cpu) / seconds, 3),
        }


def slope(points: Sequence[tuple[float, float]]) -> float:
    """Of the least-squares line through points; 0 of fewer than two."""
    if len(points) < 2:
        return 0.0
    x_mean = sum(x for x, _ in points) / len(points)
    y_mean = sum(y for _, y in points) / len(points)
    spread = sum((x - x_mean) ** 2 for x, _ in points)
    return sum((x - x_mean) * (y - y_mean) for x, y in points) / spread


def resident_bytes(pid: int) -> int:
    """Resident set of a process; 0 if it has ended."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except OSError:
        return 0


def cpu_seconds(pid: int) -> float:
    """User and system time of a process with all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def children(pid: int) -> list[int]:
    """Processes that a process started, and theirs."""
    found: list[int] = []
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            direct = [int(child) for child in path.read_text().split()]
        except OSError:
            continue
        for child in direct:
            found += [child, *children(child)]
    return found


def free_port() -> int:
    """A port of the loopback interface that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
