"""A store that can be full: a small file system of its own where that is allowed, else a file that says so."""

from __future__ import annotations

import subprocess
from pathlib import Path

from support.chaos.probe import FULL

SIZE = "192m"
BALLAST = "ballast"


class Disk:
    """A folder on a disk that `fill` leaves no room on.

    Args:
        folder: The arena's own.
        small: Whether a small file system is tried for.
    """

    def __init__(self, folder: Path, small: bool) -> None:
        self.path, self._sign = folder / "disk", folder / FULL
        self.path.mkdir()
        command = ["mount", "-t", "tmpfs", "-o", f"size={SIZE},mode=0755", "tmpfs", str(self.path)]
        self.is_real = small and _succeeds(command)

    def fill(self) -> None:
        """Leaves no room."""
        if not self.is_real:
            self._sign.touch()
            return
        try:
            with (self.path / BALLAST).open("wb", buffering=0) as stream:
                while True:
                    stream.write(bytes(4096))
        except OSError:
            return

    def free(self) -> None:
        """Makes room again."""
        (self.path / BALLAST if self.is_real else self._sign).unlink(missing_ok=True)

    def close(self) -> None:
        """Takes the file system away."""
        if self.is_real:
            _succeeds(["umount", "-l", str(self.path)])


def _succeeds(command: list[str]) -> bool:
    try:
        return subprocess.run(command, capture_output=True).returncode == 0
    except OSError:
        return False
