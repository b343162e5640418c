"""Jobs of a server: submitted, followed, stopped."""

from __future__ import annotations

import math
import uuid
from collections.abc import Iterator, Mapping
from typing import Any, Final

import httpx

from diaphane.client.events import server_sent
from diaphane.client.group import Group, segment
from diaphane.client.records import Record, Records
from diaphane.client.transport import Backoff, RefusedRequest
from schemas.problem import ExitCode

FINAL_STATES: Final = ("cancelled", "succeeded", "failed")


class Jobs(Group):
    """Jobs of a server."""

    def submit(self, spec: Mapping[str, Any], idempotency_key: str | None = None) -> tuple[Record, bool]:
        """Submits a job.

        Args:
            spec: A `schemas.job.JobSpec` as JSON.
            idempotency_key: The same key with the same spec is the same job; None: a new job.

        Returns:
            The job, and whether it is new.
        """
        headers = {"Idempotency-Key": idempotency_key or uuid.uuid4().hex}
        response = self._transport.request("POST", "/v1/jobs", json=spec, headers=headers)
        return Record(response.json()), response.status_code != httpx.codes.OK

    def get(self, job_id: str) -> Record:
        """A job."""
        return self._ask("GET", f"/v1/jobs/{segment(job_id)}")

    def list(self, limit: int | None = None, **filters: str | None) -> Records:
        """Jobs, newest first, by state, kind, name."""
        return self._items("/v1/jobs", filters, limit)

    def wait(self, job_id: str) -> Record:
        """A job once it has ended, well or not."""
        for _ in self.events(job_id):
            pass
        return self.get(job_id)

    def cancel(self, job_id: str) -> Record:
        """Asks a job to stop."""
        return self._ask("POST", f"/v1/jobs/{segment(job_id)}/cancel")

    def retry(self, job_id: str) -> Record:
        """Lets a failed or cancelled job go on."""
        return self._ask("POST", f"/v1/jobs/{segment(job_id)}/retry", repeatable=False)

    def tasks(self, job_id: str, limit: int | None = None, **filters: str | None) -> Records:
        """Tasks of a job, by stage and state."""
        return self._items(f"/v1/jobs/{segment(job_id)}/tasks", filters, limit)

    def past_events(self, job_id: str, after: int = 0) -> Iterator[Record]:
        """What has happened in a job until now, after the event of that number."""
        path = f"/v1/jobs/{segment(job_id)}/events"
        while items := self._ask("GET", path, params={"after": after})["items"]:
            yield from items
            after = items[-1]["number"]

    def events(self, job_id: str, after: int = 0) -> Iterator[Record]:
        """What happens in a job, until it ends; each event once, however often the connection breaks.

        Args:
            job_id: The job.
            after: Number of the last event that is known already.

        Raises:
            Problem: There is no such job, or the server is away for too long.
        """
        # Where events cannot be streamed, as behind some proxies, they are asked for again and again instead.
        backoff = Backoff(math.inf)
        while True:
            asked = None
            try:
                for event in self._listen(job_id, after):
                    after, backoff = event["number"], Backoff(math.inf)
                    yield event
            except httpx.TransportError:
                pass  # the next request waits for the server to come back, or says that it does not
            except RefusedRequest as refused:
                if refused.code is not ExitCode.TRY_AGAIN:
                    raise
                asked = refused.retry_after
            ended = self.get(job_id)["state"] in FINAL_STATES
            for event in self.past_events(job_id, after):
                after = event["number"]
                yield event
            if ended:
                return
            backoff.pause(asked)

    def _listen(self, job_id: str, after: int) -> Iterator[Record]:
        headers = {"Accept": "text/event-stream", "Cache-Control": "no-store", "Last-Event-ID": str(after)}
        with self._transport.stream(f"/v1/jobs/{segment(job_id)}/events", headers=headers) as response:
            yield from server_sent(response.iter_bytes())
