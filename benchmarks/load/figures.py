"""Latencies and errors of many requests."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Tally:
    """What happened.

    Attributes:
        seconds: Operation -> seconds of each.
        bytes: Operation -> bytes received.
        errors: What was wrong, with counts.
    """

    seconds: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    bytes: Counter[str] = field(default_factory=Counter)
    errors: Counter[str] = field(default_factory=Counter)

    def took(self, operation: str, seconds: float, size: int = 0) -> None:
        """Notes one that succeeded."""
        self.seconds[operation].append(seconds)
        self.bytes[operation] += size

    def wrong(self, operation: str, what: object) -> None:
        """Notes one that did not."""
        self.errors[f"{operation}: {what}"] += 1

    def add(self, other: Tally) -> None:
        """Adds what another one noted of other operations."""
        self.seconds.update(other.seconds)
        self.bytes.update(other.bytes)
        self.errors.update(other.errors)

    def figures(self, duration: float) -> dict[str, Any]:
        """Figures of each operation, milliseconds, and the errors.

        Args:
            duration: Seconds in which all of it happened.
        """
        found = {
            operation: {
                "count": len(values),
                "per_second": round(len(values) / duration, 1),
                "mib_per_second": round(self.bytes[operation] / 2**20 / duration, 1),
                **{f"p{percent}_ms": round(1000.0 * quantile(values, percent / 100.0), 1) for percent in (50, 95, 99)},
                "max_ms": round(1000.0 * max(values), 1),
            }
            for operation, values in sorted(self.seconds.items())
        }
        return {"operations": found, "errors": sum(self.errors.values()), "error_kinds": dict(self.errors)}


def quantile(values: Sequence[float], q: float) -> float:
    """The least value that at least the part `q` of all does not exceed."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(q * len(ordered)) - 1)]
