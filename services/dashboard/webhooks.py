"""`/webhooks`: which servers hear of what happens here, and what was sent lately; for administrators."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request, Response
from pydantic import BaseModel, ConfigDict, StringConstraints, model_validator

from schemas.limits import LIMITS
from schemas.webhook import WEBHOOK_EVENTS, WebhookEvent, WebhookRecord
from services.api.parts import Services, WebhookId
from services.api.security import Caller, Needs
from services.dashboard.page import PageRoute, redirect, render
from services.dashboard.visitor import FormBody, NoFields
from services.service import Service

router = APIRouter(
    prefix="/webhooks", route_class=PageRoute, include_in_schema=False, dependencies=[Depends(Needs("admin"))]
)

_RECENT = 10
"""Deliveries of a webhook that the page shows."""

_Button = Annotated[NoFields, Depends(FormBody(NoFields))]


class NewWebhookForm(BaseModel):
    """A form with an address, and a box to tick for each event."""

    model_config = ConfigDict(frozen=True, extra="forbid", str_strip_whitespace=True)

    url: Annotated[str, StringConstraints(min_length=1, max_length=LIMITS.webhook_url)]
    events: tuple[WebhookEvent, ...]

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, fields: dict[str, str]) -> dict[str, Any]:
        others = {name: value for name, value in fields.items() if name not in WEBHOOK_EVENTS}
        return {**others, "events": tuple(event for event in WEBHOOK_EVENTS if event in fields)}


@router.get("", response_class=Response)
def list_webhooks(request: Request, service: Services) -> Response:
    """All webhooks, each with its last deliveries."""
    return _page(request, service)


@router.post("", response_class=Response)
def create_webhook(
    request: Request,
    service: Services,
    caller: Caller,
    form: Annotated[NewWebhookForm, Depends(FormBody(NewWebhookForm))],
) -> Response:
    """Makes a webhook. The page that answers shows its secret, and no other one does."""
    made, secret = service.webhooks.create(form.url, form.events, caller.id)
    page = _page(request, service, made, secret)
    page.headers["Cache-Control"] = "no-store"
    return page


@router.post("/{webhook_id}/test", response_class=Response)
def send_test(webhook_id: WebhookId, service: Services, _: _Button) -> Response:
    """Sends a test."""
    service.webhooks.test(webhook_id)
    return redirect(f"/webhooks#{webhook_id}")


@router.post("/{webhook_id}/delete", response_class=Response)
def delete_webhook(webhook_id: WebhookId, service: Services, _: _Button) -> Response:
    """Removes a webhook."""
    service.webhooks.delete(webhook_id)
    return redirect("/webhooks")


def _page(request: Request, service: Service, made: WebhookRecord | None = None, secret: str = "") -> Response:
    found = [(webhook, service.webhooks.deliveries(webhook.id, limit=_RECENT)) for webhook in service.webhooks.list()]
    fresh = any(one.state == "waiting" and one.attempts == 0 for _, sent in found for one in sent)
    names = service.keys.names({webhook.created_by for webhook, _ in found})
    return render(
        request,
        "webhooks",
        webhooks=found,
        fresh=fresh,
        made=made,
        secret=secret,
        events=WEBHOOK_EVENTS,
        key_names=names,
        recent=_RECENT,
    )
