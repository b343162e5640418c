"""Pulls that are killed at random lines: `python -m support.killed_pull FOLDER POINTS` prints what each one left.

FOLDER has `wire.json` (records and blobs of a `CutWire`, hex) and `before/`, the folder of an earlier pull. Each pull
is a forked process that kills itself, so that nothing is tidied up and nothing that was buffered is written.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import random
import shutil
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import Any

import httpx

from diaphane_client import cached, pull
from diaphane_client import server as client_server
from support.cut_wire import CutWire

URL = "http://registry.test"
_MODULES = ("pulling", "cache", "files", "server", "trust", "trust_file")
TRACED = (*(f"diaphane_client/{name}.py" for name in _MODULES), "/shutil.py")
"""Where the folder is changed."""


class Killer:
    """Counts lines of `TRACED`, and kills its process at one of them."""

    def __init__(self, line: int) -> None:
        self.line, self.count = line, 0

    def __call__(self, frame: FrameType, event: str, _: Any) -> Any:
        if event == "call":
            return self if frame.f_code.co_filename.endswith(TRACED) else None
        self.count += event == "line"
        if self.count == self.line:
            os.kill(os.getpid(), signal.SIGKILL)
        return self


def traced_pull(bundles: Path, line: int, report: Path | None = None) -> int:
    """Pulls in a process of its own that is killed at a line; how it ended."""
    process = os.fork()
    if process == 0:
        killer = Killer(line)
        sys.settrace(killer)
        pull("glass", url=URL, key=None, folder=bundles)
        sys.settrace(None)
        if report:
            report.write_text(str(killer.count))
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def is_whole(folder: Path) -> bool:
    """Whether a visible version has all files of its manifest, and no others."""
    files = json.loads((folder / "manifest.json").read_bytes())["files"]
    if {path.name for path in folder.iterdir()} != {*files, "manifest.json"}:
        return False
    return all(hashlib.sha256((folder / name).read_bytes()).hexdigest() == files[name]["sha256"] for name in files)


def main(folder: Path, points: int) -> None:
    """Prints one JSON object for each kill."""
    wire = json.loads((folder / "wire.json").read_text())
    records, blobs = ({name: bytes.fromhex(body) for name, body in wire[kind].items()} for kind in ("records", "blobs"))
    client_server.httpx.Client = functools.partial(httpx.Client, transport=CutWire(records, blobs))  # type: ignore
    os.fsync = lambda _: None  # a killed process loses nothing that it gave to the system
    bundles = folder / "bundles"
    shutil.copytree(folder / "before", bundles)
    assert traced_pull(bundles, 0, folder / "lines") == 0
    lines = int((folder / "lines").read_text())
    drawn, late = random.Random(7), lines - lines // 10  # the new version is seen near the end
    early_lines = drawn.sample(range(1, late), points - points // 2)
    for line in sorted([*early_lines, *drawn.sample(range(late, lines + 1), points // 2)]):
        shutil.rmtree(bundles)
        shutil.copytree(folder / "before", bundles)
        ended = traced_pull(bundles, line)
        versions = {path.name: is_whole(path) for path in (bundles / "glass" / "versions").iterdir()}
        offline = cached("glass", url=URL, folder=bundles)
        again = pull("glass", url=URL, key=None, folder=bundles)
        left = {"line": line, "ended": ended, "versions": versions, "offline": offline and offline.name}
        print(json.dumps({**left, "again": again.name, "whole": is_whole(again)}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
