"""Token buckets: how many requests a key, or how many wrong keys an address, may send."""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

_KEPT = 10_000


@dataclass(frozen=True)
class Allowance:
    """What a bucket says.

    Attributes:
        allowed: Whether there was a token.
        left: Whole tokens left.
        wait: Seconds until the next token; 0 if there is one.
        full: Seconds until the bucket is full.
    """

    allowed: bool
    left: int
    wait: float
    full: float


class Buckets:
    """A token bucket for each name; those not used for longest are forgotten.

    Args:
        rate: Tokens a second.
        burst: Tokens that a bucket holds.
        clock: Seconds, rising.
    """

    def __init__(self, rate: float, burst: int, clock: Callable[[], float] = time.monotonic) -> None:
        self.rate, self.burst = rate, burst
        self._clock = clock
        self._levels: OrderedDict[str, tuple[float, float]] = OrderedDict()
        self._lock = threading.Lock()

    def take(self, name: str, tokens: float = 1.0) -> Allowance:
        """Takes tokens from a bucket if it has as many; `tokens` 0 only looks."""
        with self._lock:
            now = self._clock()
            level, at = self._levels.pop(name, (float(self.burst), now))
            level = min(float(self.burst), level + (now - at) * self.rate)
            allowed = level >= max(tokens, 1.0)
            level -= tokens if allowed else 0.0
            self._levels[name] = (level, now)
            if len(self._levels) > _KEPT:
                self._levels.popitem(last=False)
        wait = max(0.0, (1.0 - level) / self.rate)
        return Allowance(allowed, math.floor(level), wait, (self.burst - level) / self.rate)
