"""Takes uploads in, each in a process of its own, and watches what they touch: `runner.py CASES.json`.

One JSON line for each case: `slug` of the problem or None, `message`, `facts`, `opened` (names in the canary folders
that were opened), `connected` (whether anybody came to the port), `seconds`, and `ended`, the exit status. Compiled
kernels are kept in NUMBA_CACHE_DIR, as for the workers' children.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import socket
import struct
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2]))

from renderer.gate import RejectedScene
from renderer.gate.check import check_upload
from renderer.usd.stage import open_stage
from services.intake import inspect
from services.sandbox import enter

IN_ACCESS, IN_OPEN = 0x1, 0x20
MEMORY = 2 << 30
FILE = 64 << 20


class Watch:
    """Sees every file that is opened or read in some folders."""

    def __init__(self, folders: list[Path]) -> None:
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._handle = self._libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
        for folder in folders:
            if self._libc.inotify_add_watch(self._handle, os.fsencode(folder), IN_OPEN | IN_ACCESS) < 0:
                raise OSError(ctypes.get_errno(), "inotify")

    def seen(self) -> list[str]:
        """Names since the last call."""
        found = set()
        while True:
            try:
                data = os.read(self._handle, 1 << 16)
            except BlockingIOError:
                return sorted(found)
            at = 0
            while at < len(data):
                _, _, _, length = struct.unpack_from("iIII", data, at)
                found.add(data[at + 16 : at + 16 + length].rstrip(b"\0").decode())
                at += 16 + length


def take_in(case: dict[str, Any], write: Path) -> dict[str, Any]:
    """Does one case in this process.

    `gate`: the gate alone, without a sandbox. `whole`: everything, in it. `stage`: the sandbox without the gate.
    `bare`: neither.
    """
    folder = Path(case["folder"])
    if case["mode"] in ("whole", "stage"):
        report = enter([folder], [write, Path(os.environ["NUMBA_CACHE_DIR"])], MEMORY, FILE)
        if report.missing:
            return {"slug": "no-sandbox", "message": ", ".join(report.missing)}
    try:
        if case["mode"] == "gate":
            check_upload(folder, case["root"])
            return {"slug": None}
        if case["mode"] in ("stage", "bare"):
            open_stage(folder / case["root"])
            return {"slug": None}
        return {"slug": None, "facts": inspect(folder, case["root"])}
    except RejectedScene as problem:
        return {"slug": problem.slug, "message": f"{problem.title} {problem.remedy}"}
    except Exception as error:
        return {"slug": "unexpected", "message": f"{type(error).__name__}: {error}"}


def in_child(case: dict[str, Any], watch: Watch, port: socket.socket) -> dict[str, Any]:
    """Does one case in a process of its own, for at most `seconds`."""
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as write:
        answer = Path(write) / "answer.json"
        child = os.fork()
        if child == 0:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, 2)
            done = take_in(case, Path(write))
            answer.write_text(json.dumps(done), encoding="utf-8")
            os._exit(0)
        status = None
        while time.monotonic() < started + case["seconds"]:
            found, status = os.waitpid(child, os.WNOHANG)
            if found:
                break
            time.sleep(0.005)
        else:
            os.kill(child, signal.SIGKILL)
            _, status = os.waitpid(child, 0)
        result = json.loads(answer.read_text(encoding="utf-8")) if answer.exists() else {"slug": "ended"}
    try:
        port.accept()
        connected = True
    except BlockingIOError:
        connected = False
    seconds = time.monotonic() - started
    return {**case, **result, "opened": watch.seen(), "connected": connected, "seconds": seconds, "ended": status}


def main() -> None:
    """Every case of a file, in turn."""
    work = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    watch = Watch([Path(folder) for folder in work["watched"]])
    with socket.socket() as port:
        port.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        port.bind(("127.0.0.1", work["port"]))
        port.listen()
        port.setblocking(False)
        for case in work["cases"]:
            print(json.dumps(in_child(case, watch, port)), flush=True)


if __name__ == "__main__":
    main()
