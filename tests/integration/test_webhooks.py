"""Webhooks from end to end: real processes deliver to a real receiver that fails first, and are killed in between."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.receiver import LOOPBACK, Receiver, receiver
from support.workers import Fleet, until

from schemas.webhook import DeliveryRecord
from services.database import tables
from services.webhooks.addresses import networks_of
from services.webhooks.hooks import Webhooks


@pytest.fixture
def there() -> Iterator[Receiver]:
    with receiver() as found:
        yield found


def test_news_of_a_job_arrives_although_the_receiver_failed_and_the_worker_was_killed(
    tmp_path: Path, database_url: str, there: Receiver
) -> None:
    with Fleet(tmp_path, database_url, WEBHOOK_NETWORKS=LOOPBACK) as fleet:
        webhooks = Webhooks(fleet.database, networks_of(LOOPBACK))
        webhook, secret = webhooks.create(f"{there.url}/hook", ("job.succeeded",), "key_test")
        there.answers.append(503)
        first = fleet.worker("jobs")
        job = fleet.submit("a")
        assert fleet.wait(job).state == "succeeded"

        def failed_once() -> DeliveryRecord | None:
            found = [one for one in webhooks.deliveries(webhook.id) if one.problem]
            return found[0] if found else None

        waiting = until(failed_once, 20.0, fleet.logs)
        assert (waiting.state, waiting.attempts, waiting.status) == ("waiting", 1, 503)
        first.kill()
        with fleet.database.write() as connection:
            connection.execute(tables.deliveries.update().values(due=0.0))
        fleet.worker("jobs")
        until(lambda: webhooks.counts() == {"delivered": 1}, 20.0, fleet.logs)
        assert len(there.messages) == 2
        bodies = [message.verified(secret) for message in there.messages]
        assert {message.headers["webhook-id"] for message in there.messages} == {waiting.id}
        assert bodies[0] == bodies[1]
        assert (bodies[0]["type"], bodies[0]["data"]["id"]) == ("job.succeeded", job)
