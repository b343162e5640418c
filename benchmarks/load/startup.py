"""How long `diaphane serve` takes until it is ready, and what it loads meanwhile."""

from __future__ import annotations

import re
import statistics
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.load.service import Service, cpu_seconds

ROLES = "jobs,render,label,train"
_LINE = re.compile(r"import time:\s*(\d+) \|\s*(\d+) \|( *)(\S+)")
_SHOWN = 25


def measure(folder: Path, times: int) -> dict[str, Any]:
    """Seconds from the start of the process to the first 200 of `/v1/health/ready`, all roles, SQLite.

    The processor time is what a quiet machine would need, because nearly all of it is spent in one thread.

    Args:
        folder: For the state folders; each start but the last group makes a new one.
        times: How often.
    """
    new = [_start(folder / f"ready-{number}") for number in range(times)]
    again = [_start(folder / "ready-0") for _ in range(times)]
    return {
        "roles": ROLES,
        "new_state": _figures(new),
        "old_state": _figures(again),
        "imports": imports(folder / "imports"),
    }


def imports(state: Path) -> dict[str, Any]:
    """What is imported until the service is ready: milliseconds by package, and the dearest modules.

    `packages` holds each package's own modules; `modules` holds what a module and all that only it imported took.
    """
    with Service(state, ROLES, python=("-X", "importtime")) as service:
        service.wait_ready()
        lines = _LINE.findall(service.log.read_text(encoding="utf-8", errors="replace"))
    own: Counter[str] = Counter()
    for micros, _, _, module in lines:
        own[module.partition(".")[0]] += int(micros)
    dearest = sorted(((int(whole), module) for _, whole, _, module in lines), reverse=True)
    return {
        "total_ms": round(sum(own.values()) / 1000.0, 1),
        "count": len(lines),
        "packages_ms": {name: round(micros / 1000.0, 1) for name, micros in own.most_common(_SHOWN)},
        "modules_ms": {module: round(micros / 1000.0, 1) for micros, module in dearest[: 2 * _SHOWN]},
    }


def _start(state: Path) -> tuple[float, float]:
    with Service(state, ROLES, {"DIAPHANE_DRAIN_SECONDS": "0"}) as service:
        seconds = service.wait_ready()
        return seconds, cpu_seconds(service.process.pid)


def _figures(found: list[tuple[float, float]]) -> dict[str, Any]:
    return {
        "seconds": [round(seconds, 2) for seconds, _ in found],
        "median_seconds": round(statistics.median(seconds for seconds, _ in found), 2),
        "median_cpu_seconds": round(statistics.median(cpu for _, cpu in found), 2),
    }
