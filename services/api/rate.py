"""Token buckets: how many requests a key, or how many wrong keys an address, may send, over all processes.

A process takes from its own copy of a bucket and settles with the others through the database: once in a while, and as
soon as it has taken a part of what a bucket holds. So most requests cost no look at the database, a bucket can be
overdrawn by that part for each process, and what was overdrawn is missing afterwards: on average the rate holds. What
was taken survives a restart.
"""

from __future__ import annotations

import math
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import structlog
from sqlalchemy.exc import SQLAlchemyError

from services.api.ledger import Ledger

SETTLE_SECONDS = 0.5
"""How long what was taken is known to this process alone."""

SETTLE_PART = 8
"""A process settles at once when it has taken this part of what a bucket holds."""

_KEPT = 10_000

log = structlog.get_logger("diaphane.rate")


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
    """A token bucket for each name; those not used for longest are forgotten here, and stay in the ledger.

    Args:
        rate: Tokens a second.
        burst: Tokens that a bucket holds.
        ledger: What the processes settle through; None: this is the only one.
        clock: Seconds, rising.
    """

    def __init__(
        self, rate: float, burst: int, ledger: Ledger | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.rate, self.burst = rate, burst
        self._clock, self._ledger = clock, ledger
        self._levels: OrderedDict[str, tuple[float, float]] = OrderedDict()
        self._taken: dict[str, float] = {}
        self._settled = clock()
        self._lock, self._settling = threading.Lock(), threading.Lock()

    def take(self, name: str, tokens: float = 1.0) -> Allowance:
        """Takes tokens from a bucket if it has as many."""
        begin = self._begin(name)
        with self._lock:
            now = self._clock()
            level = self._level(name, now, begin)
            allowed = level >= tokens
            if allowed:
                level -= tokens
                if self._ledger is not None:
                    self._taken[name] = self._taken.get(name, 0.0) + tokens
            self._levels[name] = (level, now)
            self._levels.move_to_end(name)
            if len(self._levels) > _KEPT:
                self._levels.popitem(last=False)
            due = self._taken.get(name, 0.0) * SETTLE_PART >= self.burst or now - self._settled >= SETTLE_SECONDS
        if due:
            self.settle()
        wait = max(0.0, (1.0 - level) / self.rate)
        return Allowance(allowed, max(0, math.floor(level)), wait, (self.burst - level) / self.rate)

    def settle(self) -> None:
        """Tells the other processes what was taken here, and learns what they took; one thread at a time does."""
        if self._ledger is None or not self._settling.acquire(blocking=False):
            return
        try:
            with self._lock:
                taken, self._taken, self._settled = self._taken, {}, self._clock()
            if taken:
                self._adopt(self._ledger.settle(taken, self.rate, self.burst))
        except SQLAlchemyError as error:
            # What was taken counts here all the same: each process has its own bucket until the database is back.
            log.warning("allowances cannot be settled", error=type(error).__name__)
        finally:
            self._settling.release()

    def _begin(self, name: str) -> float:
        """The level of a bucket that this process has not seen yet."""
        if self._ledger is None or name in self._levels:
            return float(self.burst)
        try:
            return self._ledger.level(name, self.rate, self.burst)
        except SQLAlchemyError as error:
            log.warning("allowances cannot be read", error=type(error).__name__)
            return float(self.burst)

    def _level(self, name: str, now: float, begin: float) -> float:
        level, at = self._levels.get(name, (begin, now))
        return min(float(self.burst), level + (now - at) * self.rate)

    def _adopt(self, levels: dict[str, float]) -> None:
        """Takes over levels of the ledger, less what was taken here meanwhile."""
        with self._lock:
            now = self._clock()
            for name, level in levels.items():
                if name in self._levels:
                    self._levels[name] = (level - self._taken.get(name, 0.0), now)
