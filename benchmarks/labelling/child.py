"""A fresh process that labels stored views and says how long it took and how much memory it needed at most.

python -m benchmarks.labelling.child RULE ROUNDS BANDED FOLDER...
"""

from __future__ import annotations

import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from benchmarks.labelling.stored import dump_bytes, stored
from labeller.allocation import Allocation
from labeller.curves import error_curves
from labeller.rules import allocate_curves
from labeller.streaming import allocate_bands
from schemas.fragments import FragmentDump

BUDGETS = (0.25, 0.4, 0.5, 0.6, 0.8)
"""Shares of N."""
Rule = Literal["optimal", "greedy"]
Work = Callable[[], list[Allocation]]


@dataclass(frozen=True, slots=True)
class Cost:
    """What labelling took.

    Attributes:
        rule: The rule.
        banded: Whether the views came as row bands of one tall picture, one after the other.
        bands: How many.
        fragments: N.
        pixels: P.
        dump_bytes: Of the whole picture.
        largest_bytes: Of its largest band.
        seconds: Of each round, reading of bands left out.
        reading: Seconds that reading the bands took, in each round.
        peak_bytes: Most memory of the process during the rounds, above what it had with its input loaded.
        gaps: `(error - bound) / error` of each budget.
    """

    rule: Rule
    banded: bool
    bands: int
    fragments: int
    pixels: int
    dump_bytes: int
    largest_bytes: int
    seconds: list[float]
    reading: list[float]
    peak_bytes: int
    gaps: list[float]

    @property
    def median(self) -> float:
        """Median seconds."""
        return float(np.median(self.seconds))


def cost(folders: Sequence[Path], rule: Rule, rounds: int, banded: bool) -> Cost:
    """Labels stored views in a new process.

    Args:
        folders: One stored dump; or row bands of equal width, if `banded`.
        rule: The rule; five budgets.
        rounds: How often.
        banded: Through `labeller.streaming`.
    """
    command = [sys.executable, "-m", "benchmarks.labelling.child", rule, str(rounds), str(int(banded))]
    done = subprocess.run([*command, *map(str, folders)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"labelling in a child process failed: {done.stderr[-2000:]}")
    return Cost(**json.loads(done.stdout))


class _Bands:
    """The stored bands, again and again, with the time that reading takes."""

    def __init__(self, folders: Sequence[Path]) -> None:
        self.folders, self.seconds = folders, 0.0

    def __call__(self) -> Iterator[FragmentDump]:
        for folder in self.folders:
            start = time.perf_counter()
            band = stored(folder)
            self.seconds += time.perf_counter() - start
            yield band


def _in_one(dump: FragmentDump, rule: Rule) -> list[Allocation]:
    return allocate_curves(dump, error_curves(dump), _budgets(dump.total), rule)


def _budgets(total: int) -> list[int]:
    return [int(share * total) for share in BUDGETS]


def _tiny() -> FragmentDump:
    """Two pixels: what has to be compiled is, and no memory is needed for it."""
    n = 8
    rgba = np.arange(2 * n * 4, dtype=np.uint8).reshape(-1, 4) + np.uint8(60)
    depth = np.tile(np.arange(1, n + 1, dtype=np.float32), 2)
    offsets = np.array([0, n, 2 * n], dtype=np.int64)
    return FragmentDump(2, 1, offsets, rgba, depth, np.zeros((2, 3), np.uint8), np.full(2, 255, np.uint8))


def _memory(name: str) -> int:
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith(f"{name}:"):
            return 1024 * int(line.split()[1])
    raise KeyError(name)


def _measured(work: Work, bands: _Bands, rounds: int) -> tuple[list[float], list[float], int, list[Allocation]]:
    """Seconds and reading of each round, peak bytes, and what the last round made."""
    gc.collect()
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak so far is forgotten
    before = _memory("VmRSS")
    seconds, reading = [], []
    made: list[Allocation] = []
    for _ in range(rounds):
        made = []  # what a round made is gone before the next one begins
        bands.seconds, start = 0.0, time.perf_counter()
        made = work()
        seconds.append(time.perf_counter() - start - bands.seconds)
        reading.append(bands.seconds)
    return seconds, reading, _memory("VmHWM") - before, made


def _work(bands: _Bands, rule: Rule, banded: bool, total: int) -> Work:
    """What is measured, its kernels compiled."""
    if banded:
        allocate_bands(lambda: iter([_tiny()]), [4], rule)
        return lambda: allocate_bands(bands, _budgets(total), rule)
    _in_one(_tiny(), rule)
    (dump,) = bands()
    return lambda: _in_one(dump, rule)


def main() -> None:
    """Measures and prints a `Cost` as JSON."""
    rule: Rule = "optimal" if sys.argv[1] == "optimal" else "greedy"
    rounds, banded = int(sys.argv[2]), bool(int(sys.argv[3]))
    bands = _Bands([Path(name) for name in sys.argv[4:]])
    sizes = [(dump.total, dump.pixels, dump_bytes(dump)) for dump in bands()]
    total, pixels, size = (sum(column) for column in zip(*sizes, strict=True))
    work = _work(bands, rule, banded, total)
    seconds, reading, peak, made = _measured(work, bands, rounds)
    gaps = [allocation.gap or 0.0 for allocation in made]
    largest = max(band[2] for band in sizes)
    found = Cost(rule, banded, len(sizes), total, pixels, size, largest, seconds, reading, peak, gaps)
    print(json.dumps(asdict(found)))


if __name__ == "__main__":
    main()
