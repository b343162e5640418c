"""Deliveries that are due: each is leased to one process, and due again if that one does not say what became of it.

Rules:
- a lease is a time by the database's clock, so clocks of processes do not count;
- an outcome is taken from the process that has the lease alone; whoever lost it changes nothing;
- of a webhook one delivery is claimed at a time, the one that is due the longest: a receiver that is slow or away holds
  up its own deliveries only.
"""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from typing import Final

import sqlalchemy as sa

from services.database import Database
from services.database.clock import clock
from services.database.tables import deliveries, webhooks
from services.webhooks.sender import Outcome

LEASE_SECONDS: Final = 120.0


@dataclass(frozen=True)
class Claimed:
    """A delivery that is this process's to attempt.

    Attributes:
        id: Of the delivery.
        claim: Names the lease.
        attempt: Number of the attempt, from 1.
        url: Where to.
        secret: To sign with.
        body: What is sent.
    """

    id: str
    claim: str
    attempt: int
    url: str
    secret: str
    body: str


def claim(database: Database, lease: float = LEASE_SECONDS) -> list[Claimed]:
    """Leases what is due, one delivery of each webhook.

    Args:
        database: The service's.
        lease: Seconds after which it is due again.
    """
    table, now = deliveries, clock(database)
    is_due = (table.c.state == "waiting") & (table.c.due <= now)
    waiting = sa.select(table.c.webhook_id).where(is_due).distinct()
    with database.read() as connection:
        ids = list(connection.scalars(waiting))
    if not ids:  # so that looking takes no lock
        return []
    name = uuid.uuid4().hex

    def body(connection: sa.Connection) -> list[Claimed]:
        found: list[str] = []
        for webhook_id in sorted(ids):
            next_ = sa.select(table.c.id).where(is_due, table.c.webhook_id == webhook_id)
            next_ = next_.order_by(table.c.due, table.c.created, table.c.id).limit(1)
            found += connection.scalars(next_.with_for_update(skip_locked=True))
        leased = table.update().where(table.c.id.in_(found), is_due)
        connection.execute(leased.values(due=now + lease, attempts=table.c.attempts + 1, claim=name))
        mine = sa.select(table.c.id, table.c.attempts, table.c.body, webhooks.c.url, webhooks.c.secret)
        mine = mine.join(webhooks, webhooks.c.id == table.c.webhook_id).where(table.c.claim == name)
        return [Claimed(row.id, name, row.attempts, row.url, row.secret, row.body) for row in connection.execute(mine)]

    return database.retry(body)


def settle(database: Database, claimed: Claimed, outcome: Outcome, wait: float | None) -> bool:
    """Writes down what became of an attempt.

    Args:
        database: The service's.
        claimed: The delivery.
        outcome: Of the attempt.
        wait: Seconds until the next one; None: there is none.

    Returns:
        Whether the delivery was still this process's.
    """
    table, now = deliveries, clock(database)
    values = {"claim": None, "status": outcome.status, "problem": outcome.problem}
    mine = table.update().where(table.c.id == claimed.id, table.c.claim == claimed.claim)
    if outcome.problem is None:
        change = mine.values(**values, state="delivered", finished=now)
    elif wait is None or outcome.is_final:
        change = mine.values(**values, state="failed", finished=now)
    else:
        change = mine.values(**values, due=now + wait)
    return database.retry(lambda connection: connection.execute(change).rowcount == 1)
