"""The thread that delivers: it claims what is due, tries it, and says what became of it.

Every process that conducts jobs has one. They share the work by leases in the database, so it does not matter which of
them lives, and nothing is lost with one that dies.
"""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import structlog

from services.database import Database
from services.webhooks import queue, signature
from services.webhooks.addresses import Network
from services.webhooks.schedule import USUAL, Schedule
from services.webhooks.sender import SECONDS, send

PERIOD_SECONDS = 1.0
"""Between two looks at what is due."""
AT_ONCE = 8

log = structlog.get_logger(__name__)


class Deliverer:
    """Delivers webhooks in the background.

    Args:
        database: The service's.
        allowed: Networks that may be reached beside the public ones.
        schedule: When to try again.
        seconds: Time for an attempt.
    """

    def __init__(
        self,
        database: Database,
        allowed: Sequence[Network] = (),
        schedule: Schedule = USUAL,
        seconds: float = SECONDS,
    ) -> None:
        self._database, self._allowed = database, tuple(allowed)
        self._schedule, self._seconds = schedule, seconds
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="webhooks")

    def start(self) -> None:
        """Begins."""
        self._thread.start()

    def stop(self) -> None:
        """Ends, after what is being delivered; what takes longer is tried again once its lease is over."""
        self._end.set()
        if self._thread.is_alive():
            self._thread.join(self._seconds)

    def deliver(self) -> int:
        """Tries what is due now, one delivery of each webhook; how many."""
        due = queue.claim(self._database)
        if due:
            with ThreadPoolExecutor(AT_ONCE, "webhook") as threads:
                list(threads.map(self._attempt, due))
        return len(due)

    def _attempt(self, claimed: queue.Claimed) -> None:
        body = claimed.body.encode()
        headers = signature.headers(claimed.secret, claimed.id, int(time.time()), body)
        outcome = send(claimed.url, headers, body, self._allowed, self._seconds)
        wait = self._schedule.wait(claimed.attempt, random.random())
        queue.settle(self._database, claimed, outcome, wait)
        # Not the URL: it may have a secret of the receiver in it.
        log.info(
            "webhook", delivery=claimed.id, attempt=claimed.attempt, status=outcome.status, problem=outcome.problem
        )

    def _run(self) -> None:
        while not self._end.wait(PERIOD_SECONDS):
            try:
                while not self._end.is_set() and self.deliver():
                    pass
            except Exception as error:
                # Not the whole text: it may name the server with its credentials.
                log.warning("webhooks are tried again", reason=type(error).__name__)
