"""What happened, for every webhook that hears of it: written in the transaction in which it happened.

So nothing is told that did not happen, and nothing that happened is forgotten; delivering comes later, by whoever can.
"""

from __future__ import annotations

import json
import time
import uuid
from typing import Any

import sqlalchemy as sa

from schemas.service import MoveRecord, ProblemDocument
from schemas.webhook import TEST_EVENT, WebhookEvent
from services.clock import iso
from services.database.tables import deliveries, webhooks


def job_ended(
    connection: sa.Connection,
    row: sa.Row[Any],
    state: str,
    problem: ProblemDocument | None,
    result: dict[str, Any] | None,
) -> None:
    """A job has ended.

    Args:
        connection: The transaction that ends it.
        row: Of the job.
        state: succeeded, failed or cancelled.
        problem: Why it failed.
        result: What it made.
    """
    events: dict[str, WebhookEvent] = {
        "succeeded": "job.succeeded",
        "failed": "job.failed",
        "cancelled": "job.cancelled",
    }
    data = {"id": row.id, "kind": row.kind, "name": row.name, "attempt": row.attempt, "submitted_by": row.submitted_by}
    made = {name: (result or {}).get(name) for name in ("reference", "score", "champion")}
    _add(connection, events[state], {**data, **made, "problem": _dumped(problem)})


def scene_rejected(connection: sa.Connection, scene: sa.Row[Any], problem: ProblemDocument) -> None:
    """The check of a scene has failed.

    Args:
        connection: The transaction that rejects it.
        scene: Its id and name, and the key that sent it.
        problem: Why.
    """
    data = {"id": scene.id, "name": scene.name, "created_by": scene.created_by, "problem": _dumped(problem)}
    _add(connection, "scene.rejected", data)


def champion_moved(connection: sa.Connection, name: str, change: MoveRecord, before: str | None) -> None:
    """A name has a new champion.

    Args:
        connection: The transaction that moves the alias.
        name: Of the bundle.
        change: The move.
        before: The champion until now.
    """
    data = {"name": name, "version": change.after, "before": before, "who": change.who, "why": change.why}
    _add(connection, "model.champion", data)


def test(connection: sa.Connection, webhook_id: str) -> str:
    """Queues a delivery that nothing but a wish to see one is the reason of; its id."""
    (message_id,) = _insert(connection, [webhook_id], TEST_EVENT, {"webhook": webhook_id})
    return message_id


def _add(connection: sa.Connection, event: WebhookEvent, data: dict[str, Any]) -> None:
    # Held against a webhook's removal meanwhile: its deliveries refer to it.
    found = connection.execute(sa.select(webhooks.c.id, webhooks.c.events).with_for_update(read=True, key_share=True))
    _insert(connection, [row.id for row in found if event in row.events], event, data)


def _insert(connection: sa.Connection, webhook_ids: list[str], event: str, data: dict[str, Any]) -> list[str]:
    now = time.time()
    body = json.dumps({"type": event, "timestamp": iso(now), "data": data}, separators=(",", ":"), allow_nan=False)
    rows = [
        {
            "id": f"msg_{uuid.uuid4().hex[:24]}",
            "webhook_id": webhook_id,
            "event": event,
            "body": body,
            "state": "waiting",
            "attempts": 0,
            "created": now,
            "due": 0.0,
        }
        for webhook_id in webhook_ids
    ]
    if rows:
        connection.execute(deliveries.insert(), rows)
    return [str(row["id"]) for row in rows]


def _dumped(problem: ProblemDocument | None) -> dict[str, Any] | None:
    return None if problem is None else problem.model_dump(mode="json")
