"""Webhooks: what a service tells other servers of, where to, and what became of it. Times are ISO 8601, UTC."""

from __future__ import annotations

from typing import Literal, get_args

from pydantic import BaseModel, ConfigDict

WebhookEvent = Literal["job.succeeded", "job.failed", "job.cancelled", "scene.rejected", "model.champion"]
WEBHOOK_EVENTS: tuple[WebhookEvent, ...] = get_args(WebhookEvent)
TEST_EVENT = "webhook.test"
"""Of a delivery that somebody asked for; no webhook has to choose it."""

DeliveryState = Literal["waiting", "delivered", "failed"]
DELIVERY_STATES: tuple[DeliveryState, ...] = get_args(DeliveryState)


class WebhookRecord(BaseModel):
    """A webhook without its secret.

    Attributes:
        id: `whk_` and 24 hex digits.
        url: Where it is delivered.
        events: What it hears of.
        created: When it was made.
        created_by: Id of the key.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    url: str
    events: tuple[WebhookEvent, ...]
    created: str
    created_by: str


class DeliveryRecord(BaseModel):
    """One event on its way to one webhook.

    Attributes:
        id: `msg_` and 24 hex digits: the header `webhook-id`, the same in every attempt.
        event: The body's `type`.
        state: `waiting`: it is tried, or tried again; `failed`: it is not tried any more.
        attempts: How often it was tried.
        created: When it happened.
        next_attempt: When it is tried again; None: as soon as possible, or not at all.
        finished: When it was delivered or given up.
        status: HTTP status of the last answer; None: there was none.
        problem: Why the last attempt failed.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    event: str
    state: DeliveryState
    attempts: int
    created: str
    next_attempt: str | None = None
    finished: str | None = None
    status: int | None = None
    problem: str | None = None
