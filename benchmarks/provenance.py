"""Where a benchmark's figures come from: the head of its result file, and the line about it on its page."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from evaluation.versions import commit, library_versions, machine


def head(module: str, arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """What every result file says of itself: `created`, `command`, `machine`, `versions` and `commit`.

    Args:
        module: Dotted name of the benchmark.
        arguments: Of its command line; None: those of the process.
    """
    return {
        "created": now(),
        "command": _command(module, sys.argv[1:] if arguments is None else arguments),
        "machine": machine(),
        "versions": library_versions(),
        "commit": commit(),
    }


def now() -> str:
    """The time, UTC, ISO 8601, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


@contextmanager
def load_around(found: dict[str, Any]) -> Iterator[None]:
    """Adds `load_average`, the machine's `before` and `after` the block: others may use it too."""
    before = os.getloadavg()
    yield
    found["load_average"] = {"before": before, "after": os.getloadavg()}


def said(found: Mapping[str, Any]) -> str:
    """Machine, driver where one is named, and time of a result, in words."""
    on = found["machine"]
    about = [f"{on['processor']}, {on['cores']} cores, {on['memory']}", found.get("driver"), found["created"]]
    return "; ".join(filter(None, about))


def said_load(before: float, after: float) -> str:
    """Load averages over a minute, in words."""
    return f"load average {before:.1f} before and {after:.1f} after"


def _command(module: str, arguments: Sequence[str]) -> str:
    # Where a folder lies on this machine says nothing elsewhere, and who signs in to a database is nobody's business.
    words = (re.sub(r"(?<=://)[^/@]*@", "", word) for word in arguments)
    plain = (Path(word).name if Path(word).is_absolute() else word for word in words)
    return shlex.join(["python", "-m", module, *plain])
