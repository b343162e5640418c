"""When a delivery that failed is tried again: waits grow by a factor up to a bound, with some randomness."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Schedule:
    """How often a delivery is tried, and with which waits: ten times within a day and a half by default.

    Attributes:
        attempts: In all.
        first_seconds: Wait after the first attempt.
        factor: By which each wait is longer than the one before.
        longest_seconds: Longest wait.
        jitter: Share by which a wait may differ, so that what failed together does not come again together.
    """

    attempts: int = 10
    first_seconds: float = 5.0
    factor: float = 4.0
    longest_seconds: float = 12 * 3600.0
    jitter: float = 0.2

    def wait(self, attempt: int, chance: float) -> float | None:
        """Seconds until the next attempt.

        Args:
            attempt: Number of the one that failed, from 1.
            chance: In [0, 1), where within the jitter the wait is.

        Returns:
            The wait; None: it was the last attempt.
        """
        if attempt >= self.attempts:
            return None
        plain = min(self.longest_seconds, self.first_seconds * self.factor ** (attempt - 1))
        return plain * (1.0 + self.jitter * (2.0 * chance - 1.0))


USUAL = Schedule()
