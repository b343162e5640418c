"""Keeps builds coming, as clients do: through the API, with an idempotency key, again and again until it answers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

import httpx

from benchmarks.chaos.builds import spec
from schemas.job import FINAL_STATES, JobKind
from tests.support.cluster import API, Cluster

AT_ONCE = 4
"""Builds that have not ended."""
_LOOK_SECONDS = 0.25
_ACCEPTED = (200, 202)
_AGAIN = (429, 500, 503)


class Feeder(threading.Thread):
    """Submits builds until all are.

    Args:
        cluster: Takes them.
        families: Ids of its scenes.
        builds: How many.
        kind: What each job is.
        may: Whether the next one may come: its number is given.

    Attributes:
        jobs: Ids, in order.
        repeated: Requests that had to be sent again.
        fault: Why it ended early.
    """

    def __init__(
        self,
        cluster: Cluster,
        families: Sequence[Sequence[str]],
        builds: int,
        kind: JobKind = "build",
        may: Callable[[int], bool] = lambda number: True,
    ) -> None:
        super().__init__(daemon=True, name="feeder")
        self.jobs: list[str] = []
        self.repeated = 0
        self.fault: str | None = None
        self._cluster, self._families, self._builds, self._may = cluster, families, builds, may
        self._kind: JobKind = kind
        self._open: set[str] = set()

    @property
    def done(self) -> int:
        """Builds that have ended."""
        return len(self.jobs) - len(self._open)

    @property
    def is_through(self) -> bool:
        """Whether all were submitted and have ended, or it gave up."""
        return self.fault is not None or self.done == self._builds

    def run(self) -> None:
        """Submits and watches."""
        while not self.is_through:
            with suppress(Exception):  # the database may be away
                self._open = {job for job in self._open if not self._has_ended(job)}
            number = len(self.jobs)
            if number < self._builds and len(self._open) < AT_ONCE and self._may(number):
                self._submit(number)
            time.sleep(_LOOK_SECONDS)

    def _has_ended(self, job_id: str) -> bool:
        return self._cluster.service.jobs.get(job_id).state in FINAL_STATES

    def _submit(self, number: int) -> None:
        servers = [member.slot.url for member in self._cluster.members if member.kind == API]
        headers = {"Idempotency-Key": f"build-{number}"}
        try:
            with self._cluster.client(servers[(number + self.repeated) % len(servers)]) as client:
                answer = client.post("/v1/jobs", json=spec(self._families, number, self._kind), headers=headers)
        except (httpx.TransportError, IndexError):
            self.repeated += 1
            return
        if answer.status_code in _ACCEPTED:
            self._open.add(str(answer.json()["id"]))
            self.jobs.append(str(answer.json()["id"]))
        elif answer.status_code in _AGAIN:
            self.repeated += 1
        else:
            self.fault = f"build {number}: {answer.status_code} {answer.text}"
