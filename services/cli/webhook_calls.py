"""Webhooks of a server as Python calls."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from schemas.problem import Problem

if TYPE_CHECKING:
    from services.cli.transport import Transport

JSON = dict[str, Any]
_ID = re.compile(r"whk_[0-9a-f]{24}")
_POLL_SECONDS = 0.25


class WebhookCalls:
    """Webhooks of a server.

    Args:
        transport: How it is reached.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def create(self, url: str, events: Sequence[str]) -> JSON:
        """Makes a webhook; its secret is in this answer and nowhere else. No events: all of them."""
        body = {"url": url, **({"events": list(events)} if events else {})}
        made: JSON = self._transport.request("POST", "/v1/webhooks", json=body, repeatable=False).json()
        return made

    def list(self) -> Iterator[JSON]:
        """All webhooks, newest first."""
        return self._transport.items("/v1/webhooks")

    def delete(self, webhook_id: str) -> None:
        """Removes a webhook, with its deliveries."""
        self._transport.request("DELETE", _path(webhook_id))

    def deliveries(self, webhook_id: str, limit: int | None = None) -> Iterator[JSON]:
        """What was or is to be sent to a webhook, newest first."""
        return self._transport.items(f"{_path(webhook_id)}/deliveries", limit=limit)

    def test(self, webhook_id: str, patience: float) -> JSON:
        """Sends a test; the delivery once it was tried, or as it is after `patience` seconds."""
        sent: JSON = self._transport.request("POST", f"{_path(webhook_id)}/test", repeatable=False).json()
        end = time.monotonic() + patience
        while not (sent["status"] or sent["problem"]) and time.monotonic() < end:
            time.sleep(_POLL_SECONDS)
            recent = self.deliveries(webhook_id, 200)
            sent = next((one for one in recent if one["id"] == sent["id"]), sent)
        return sent


def _path(webhook_id: str) -> str:
    if not _ID.fullmatch(webhook_id):
        raise Problem(f"'{webhook_id}' is not the id of a webhook.", "Copy it from `diaphane webhooks list`: whk_...")
    return f"/v1/webhooks/{webhook_id}"
