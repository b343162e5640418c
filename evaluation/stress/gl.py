"""Every GLSL pass on every GL driver that this machine has, against float64 (METHOD.md section 6).

A process has one GL context, and its driver is chosen by the environment, so each driver has a child process
(`evaluation.stress.gl_child`); they run side by side. One that crashes, or is silent for too long, is a violation that
names what it was doing.
"""

from __future__ import annotations

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from evaluation.stress import gl_refused
from evaluation.stress.findings import Broken, Finding, NotRun, Options, Row
from evaluation.stress.gl_bounds import BOUNDS
from evaluation.stress.gl_child import KINDS
from evaluation.stress.gl_drivers import GPU, LLVMPIPE, ZINK, environment, gpu_here

SILENCE = 180.0
"""Seconds without a line after which a child hangs: the slowest picture takes a few on one slow core."""

_END = None


class Child:
    """The suite in a process of its own.

    Args:
        name: Of the driver.
        command: Starts it.
        variables: Its environment.

    Attributes:
        digests: Hash of the fragments of each case, complete when the rows are.
    """

    def __init__(self, name: str, command: Sequence[str], variables: dict[str, str]) -> None:
        self.name = name
        self.digests: dict[str, str] = {}
        self._at = "start"
        self._errors = tempfile.TemporaryFile(mode="w+", encoding="utf-8", errors="replace")  # noqa: SIM115 - closed by close
        self._process = subprocess.Popen(
            command, env=variables, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=self._errors, text=True
        )
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self._process.stdout is not None, "it is a pipe"
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(_END)

    def rows(self) -> Iterator[Row]:
        """Rows as they come; a crash or a hang is the last one."""
        path = f"gl · {self.name}"
        while True:
            try:
                line = self._lines.get(timeout=SILENCE)
            except queue.Empty:
                yield Broken(path, f"hung for {SILENCE:.0f} s at: {self._at}")
                return
            if line is _END:
                break
            yield from self._row(json.loads(line))
        status = self._process.wait()
        if status != 0 or self._at:
            yield Broken(path, f"ended with status {status} at: {self._at}. {self._last_error()}".strip())

    def _row(self, line: dict[str, Any]) -> Iterator[Row]:
        if "at" in line:
            self._at = line["at"]
        elif "digest" in line:
            self.digests[line["case"]] = line["digest"]
        else:
            yield KINDS[line.pop("row")](**line)

    def _last_error(self) -> str:
        self._errors.seek(0)
        return next((line.strip() for line in reversed(self._errors.readlines()) if line.strip()), "")

    def close(self) -> None:
        """End it if it still runs."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()
        self._errors.close()


def run(options: Options) -> Iterator[Row]:
    """The rows of every driver, those of one after those of the other; the loader's and the drivers' agreement last."""
    with tempfile.TemporaryDirectory() as folder:
        runtime = Path(folder)
        runtime.chmod(0o700)
        children = _children(options, runtime)
        try:
            for child in children:
                yield from child.rows()
            yield from agreement(children[0].digests, children[1].digests)
        finally:
            for child in children:
                child.close()
    if not gpu_here():
        yield NotRun("gl · gpu", "This machine shows no GPU.")
    yield from gl_refused.rows()


def agreement(one: dict[str, str], other: dict[str, str]) -> Iterator[Finding]:
    """Whether both software drivers captured the same bits of every case that both have rendered."""
    common = one.keys() & other.keys()
    if not common:
        return
    differ = sorted(case for case in common if one[case] != other[case])
    bound, count = BOUNDS["capture.bits"], float(len(differ))
    where = ", ".join(differ) or "nowhere"
    path = f"capture · {LLVMPIPE.name} = {ZINK.name}"
    yield Finding(path, f"{len(common)} dumps, by sha256", count, count / len(common), where, 0.0, bound.measure)


def _children(options: Options, runtime: Path) -> list[Child]:
    """llvmpipe's, zink's, and the GPU's if there is one."""
    drivers = [LLVMPIPE, ZINK, *([GPU] if gpu_here() else [])]
    threads = max(1, len(os.sched_getaffinity(0)) // len(drivers))
    arguments = [*(["--quick"] if options.quick else []), "--seed", str(options.seed)]
    return [
        Child(
            driver.name,
            [sys.executable, "-m", "evaluation.stress.gl_child", driver.name, *arguments],
            environment(driver, runtime, threads),
        )
        for driver in drivers
    ]
