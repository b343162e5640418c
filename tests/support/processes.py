"""The services of docker-compose.yml as plain processes: their commands, environments and health checks."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Set
from importlib.metadata import packages_distributions
from pathlib import Path

from support.deploy import CONTAINERS, ROOT, filled_in, own_services, pins

BLOCKED = ROOT / "tests" / "support" / "blocked"
INHERITED = ("PATH", "LANG", "LD_LIBRARY_PATH", "COVERAGE_PROCESS_START")


def missing_from(image: str) -> list[str]:
    """Import names of what is installed here and is not in an image."""
    return missing_beyond(set(pins(CONTAINERS / f"requirements-{image}.lock")))


def missing_beyond(distributions: Set[str]) -> list[str]:
    """Import names of what is installed here and is of none of some distributions, nor Diaphane's own."""
    held = distributions | {"diaphane"}
    return sorted(
        name
        for name, providers in packages_distributions().items()
        if not any(re.sub(r"[-_.]+", "-", found).lower() in held for found in providers)
    )


class Service:
    """One service, with only the packages of its image.

    Args:
        name: In docker-compose.yml.
        folder: Stands for its volume and its `/tmp`.
        variables: As in `.env`.
        instead: Environment that differs, because there is no network of containers.
    """

    def __init__(self, name: str, folder: Path, variables: Mapping[str, str], instead: Mapping[str, str]) -> None:
        self.name, self._service = name, own_services()[name]
        self._folder = folder / name
        (self._folder / "tmp").mkdir(parents=True)
        image = self._service["image"].partition(":")[0].removeprefix("diaphane/")
        given = {key: filled_in(value, variables) for key, value in self._service["environment"].items()}
        self.environment = {
            **{key: os.environ[key] for key in INHERITED if key in os.environ},
            **given,
            **{key: value for key, value in instead.items() if key in given or key == "DIAPHANE_URL"},
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "HOME": str(self._folder),
            "TMPDIR": str(self._folder / "tmp"),
            "DIAPHANE_STATE": str(self._folder),
            "PYTHONPATH": str(BLOCKED),
            "BLOCKED_IMPORTS": ",".join(missing_from(image)),
        }
        self._process: subprocess.Popen[bytes] | None = None
        self._was_healthy = False

    @property
    def log(self) -> str:
        """What it wrote."""
        path = self._folder / "log"
        return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""

    def start(self, port: int) -> None:
        """Starts the container's command; `port` instead of the API's own."""
        command = [str(port) if word == "8035" else word for word in self._service["command"]]
        with (self._folder / "log").open("ab") as log:
            self._process = subprocess.Popen(
                command, env=self.environment, cwd=self._folder, stdout=log, stderr=log, start_new_session=True
            )

    def check(self) -> subprocess.CompletedProcess[str]:
        """Runs the container's health check."""
        return self.run(*self._service["healthcheck"]["test"][1:])

    def run(self, *command: str, **variables: str) -> subprocess.CompletedProcess[str]:
        """Runs a command as in the container."""
        environment = {**self.environment, **variables}
        return subprocess.run(command, env=environment, cwd=self._folder, capture_output=True, text=True, timeout=480.0)

    def wait_until_healthy(self, seconds: float) -> None:
        """Checks until it is well; not again if it was."""
        if self._was_healthy:
            return
        end = time.monotonic() + seconds
        while (found := self.check()).returncode != 0:
            assert self._process is not None
            assert self._process.poll() is None, f"{self.name} ended:\n{self.log[-4000:]}"
            assert time.monotonic() < end, f"{self.name}: {found.stderr}\n{self.log[-4000:]}"
            time.sleep(0.2)
        self._was_healthy = True

    def tell_to_stop(self) -> None:
        """As docker does."""
        assert self._process is not None
        self._process.send_signal(signal.SIGTERM)

    def wait(self, seconds: float) -> int:
        """Waits for its end; its exit status."""
        assert self._process is not None
        return self._process.wait(seconds)

    def kill(self) -> None:
        """Ends it and whatever it started."""
        if self._process is not None and self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait(10.0)
