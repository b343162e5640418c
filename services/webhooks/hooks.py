"""The webhooks of a service: who is told of what, and what became of it."""

from __future__ import annotations

import builtins
import ipaddress
import secrets
import time
from collections.abc import Sequence
from typing import Any

import sqlalchemy as sa

from schemas.limits import LIMITS
from schemas.problem import ExitCode, Problem
from schemas.webhook import WEBHOOK_EVENTS, DeliveryRecord, WebhookEvent, WebhookRecord
from services.clock import iso
from services.database import Database
from services.database.tables import deliveries, webhooks
from services.webhooks import outbox
from services.webhooks.addresses import Network, is_allowed, parse
from services.webhooks.signature import new_secret

_PATIENCE_SECONDS = 5.0


class Webhooks:
    """The webhooks of a service.

    Args:
        database: Their records.
        allowed: Networks that they may lead to beside the public ones.
    """

    def __init__(self, database: Database, allowed: Sequence[Network] = ()) -> None:
        self._database, self._allowed = database, tuple(allowed)

    def create(self, url: str, events: Sequence[WebhookEvent], by: str) -> tuple[WebhookRecord, str]:
        """Makes a webhook.

        Args:
            url: Where it is delivered.
            events: What it hears of; at least one.
            by: Id of the key.

        Returns:
            The record, and the secret that deliveries are signed with: it cannot be had again.

        Raises:
            Problem: The URL leads where no webhook may, no event is chosen, or there are too many webhooks.
        """
        self._require_place(url)
        if not events:
            raise Problem("A webhook needs at least one event.", f"Choose among {', '.join(WEBHOOK_EVENTS)}.")
        secret = new_secret()
        row = {
            "id": f"whk_{secrets.token_hex(12)}",
            "url": url,
            "events": [event for event in WEBHOOK_EVENTS if event in events],
            "secret": secret,
            "created": time.time(),
            "created_by": by,
        }

        def insert(connection: sa.Connection) -> None:
            if connection.scalar(sa.select(webhooks.c.id).where(webhooks.c.id == row["id"])) is not None:
                return  # it is run again
            if int(connection.scalar(sa.select(sa.func.count()).select_from(webhooks)) or 0) >= LIMITS.webhooks:
                raise Problem(
                    f"There are {LIMITS.webhooks} webhooks, as many as there may be.",
                    "Delete one that nobody needs any more.",
                    ExitCode.LIMIT,
                )
            connection.execute(webhooks.insert().values(**row))

        self._database.retry(insert, _PATIENCE_SECONDS)
        return _record(row), secret

    def list(self) -> list[WebhookRecord]:
        """All webhooks, newest first."""
        query = sa.select(webhooks).order_by(webhooks.c.created.desc(), webhooks.c.id)
        with self._database.read() as connection:
            return [_record(row) for row in connection.execute(query).mappings()]

    def delete(self, webhook_id: str) -> None:
        """Removes a webhook, with its deliveries.

        Raises:
            Problem: There is none of this id.
        """

        def body(connection: sa.Connection) -> int:
            return connection.execute(webhooks.delete().where(webhooks.c.id == webhook_id)).rowcount

        if not self._database.retry(body, _PATIENCE_SECONDS):
            raise _unknown(webhook_id)

    def test(self, webhook_id: str) -> DeliveryRecord:
        """Queues a delivery of the event `webhook.test`.

        Raises:
            Problem: There is no such webhook.
        """

        def body(connection: sa.Connection) -> str:
            held = sa.select(webhooks.c.id).where(webhooks.c.id == webhook_id)
            if connection.scalar(held.with_for_update(read=True, key_share=True)) is None:
                raise _unknown(webhook_id)
            return outbox.test(connection, webhook_id)

        message_id = self._database.retry(body, _PATIENCE_SECONDS)
        with self._database.read() as connection:
            row = connection.execute(sa.select(deliveries).where(deliveries.c.id == message_id)).mappings().one()
        return _delivery(row)

    def deliveries(
        self, webhook_id: str, *, limit: int = 50, after: tuple[float, str] | None = None
    ) -> builtins.list[DeliveryRecord]:
        """Deliveries of a webhook, newest first.

        Args:
            webhook_id: The webhook.
            limit: How many at most.
            after: Only those that come after the one with this time and id.

        Raises:
            Problem: There is no such webhook.
        """
        table = deliveries
        query = sa.select(table).where(table.c.webhook_id == webhook_id)
        query = query.order_by(table.c.created.desc(), table.c.id.desc()).limit(limit)
        if after is not None:
            place = sa.tuple_(table.c.created, table.c.id)
            query = query.where(place < sa.tuple_(sa.literal(after[0]), sa.literal(after[1])))
        with self._database.read() as connection:
            if connection.scalar(sa.select(webhooks.c.id).where(webhooks.c.id == webhook_id)) is None:
                raise _unknown(webhook_id)
            return [_delivery(row) for row in connection.execute(query).mappings()]

    def counts(self) -> dict[str, int]:
        """How many deliveries are in each state."""
        query = sa.select(deliveries.c.state, sa.func.count()).group_by(deliveries.c.state)
        with self._database.read() as connection:
            return {state: int(count) for state, count in connection.execute(query)}

    def _require_place(self, url: str) -> None:
        """Refuses at once what no attempt could deliver: a name is judged at each attempt, by what it then means."""
        host = parse(url).host
        try:
            address = ipaddress.ip_address(host)
        except ValueError:
            return
        if not is_allowed(address, self._allowed):
            raise Problem(
                f"The address {host} is not public, so no webhook may lead there.",
                "Name a public address, or have the operator allow its network with DIAPHANE_WEBHOOK_NETWORKS.",
            )


def _unknown(webhook_id: str) -> Problem:
    return Problem(f"There is no webhook {webhook_id}.", "List the webhooks.", ExitCode.NOT_FOUND)


def _record(row: Any) -> WebhookRecord:
    return WebhookRecord(
        id=row["id"],
        url=row["url"],
        events=tuple(row["events"]),
        created=iso(row["created"]),
        created_by=row["created_by"],
    )


def _delivery(row: Any) -> DeliveryRecord:
    is_put_off = row["state"] == "waiting" and row["attempts"] > 0
    return DeliveryRecord(
        id=row["id"],
        event=row["event"],
        state=row["state"],
        attempts=row["attempts"],
        created=iso(row["created"]),
        next_attempt=iso(row["due"]) if is_put_off and row["claim"] is None else None,
        finished=None if row["finished"] is None else iso(row["finished"]),
        status=row["status"],
        problem=row["problem"],
    )
