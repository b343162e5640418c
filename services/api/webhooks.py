"""`/v1/webhooks`: who is told of what happens; for administrators."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, Response

from schemas.webhook import DeliveryRecord
from services.api.answers import CreatedWebhook, DeliveryPage, NewWebhook, WebhookPage
from services.api.body import JsonBody
from services.api.pages import LINK_HEADER, MOMENT, Page
from services.api.parts import Services, WebhookId
from services.api.places import moment
from services.api.security import Caller, Needs
from services.database import tables

router = APIRouter(prefix="/v1/webhooks", tags=["webhooks"], dependencies=[Depends(Needs("admin"))])


@router.get("", responses={200: {"headers": LINK_HEADER}})
def list_webhooks(service: Services, paging: Page) -> WebhookPage:
    """All webhooks, newest first, without their secrets."""
    return WebhookPage(items=paging.slice(service.webhooks.list(), lambda webhook: webhook.id))


@router.post("", status_code=201)
def create_webhook(
    body: Annotated[NewWebhook, Depends(JsonBody(NewWebhook))], service: Services, caller: Caller, response: Response
) -> CreatedWebhook:
    """Makes a webhook; the secret that its deliveries are signed with is in this answer and nowhere else."""
    webhook, secret = service.webhooks.create(body.url, body.events, caller.id)
    response.headers["Cache-Control"] = "no-store"
    return CreatedWebhook(webhook=webhook, secret=secret)


@router.delete("/{webhook_id}", status_code=204)
def delete_webhook(webhook_id: WebhookId, service: Services) -> None:
    """Removes a webhook, with its deliveries, also those that still wait."""
    service.webhooks.delete(webhook_id)


@router.post("/{webhook_id}/test", status_code=202)
def test_webhook(webhook_id: WebhookId, service: Services) -> DeliveryRecord:
    """Queues a delivery of the event `webhook.test`; the deliveries tell what became of it."""
    return service.webhooks.test(webhook_id)


@router.get("/{webhook_id}/deliveries", responses={200: {"headers": LINK_HEADER}})
def list_deliveries(webhook_id: WebhookId, service: Services, paging: Page) -> DeliveryPage:
    """What was sent or is to be sent to a webhook, newest first."""
    found = service.webhooks.deliveries(webhook_id, limit=paging.fetch, after=paging.after(MOMENT))
    place = lambda one: moment(service.database, tables.deliveries, one.id, one.created)  # noqa: E731
    return DeliveryPage(items=paging.page(found, place))
