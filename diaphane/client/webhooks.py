"""Webhooks of a server."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence

from diaphane.client.group import Group
from diaphane.client.records import Record, Records
from schemas.problem import Problem

_ID = re.compile(r"whk_[0-9a-f]{24}")
_POLL_SECONDS = 0.25


class Webhooks(Group):
    """Which servers hear of what happens on a server."""

    def create(self, url: str, events: Sequence[str] = ()) -> Record:
        """Makes a webhook; its secret is in this answer and nowhere else. No events: all of them."""
        body = {"url": url, **({"events": [*events]} if events else {})}
        return self._ask("POST", "/v1/webhooks", json=body, repeatable=False)

    def list(self) -> Records:
        """All webhooks, newest first."""
        return self._items("/v1/webhooks")

    def delete(self, webhook_id: str) -> None:
        """Removes a webhook, with its deliveries."""
        self._transport.request("DELETE", _path(webhook_id))

    def deliveries(self, webhook_id: str, limit: int | None = None) -> Records:
        """What was or is to be sent to a webhook, newest first."""
        return self._items(f"{_path(webhook_id)}/deliveries", limit=limit)

    def test(self, webhook_id: str, patience: float) -> Record:
        """Sends a test; the delivery once it was tried, or as it is after `patience` seconds."""
        sent = self._ask("POST", f"{_path(webhook_id)}/test", repeatable=False)
        end = time.monotonic() + patience
        while not (sent["status"] or sent["problem"]) and time.monotonic() < end:
            time.sleep(_POLL_SECONDS)
            sent = next((one for one in self.deliveries(webhook_id, 200) if one["id"] == sent["id"]), sent)
        return sent


def _path(webhook_id: str) -> str:
    if not _ID.fullmatch(webhook_id):
        raise Problem(f"'{webhook_id}' is not the id of a webhook.", "Copy it from `diaphane webhooks list`: whk_...")
    return f"/v1/webhooks/{webhook_id}"
