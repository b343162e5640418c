"""What the parts of a client share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diaphane.client.records import Record, Records
from diaphane.client.transport import Transport
from schemas.problem import Problem


class Group:
    """Things of one kind on a server.

    Args:
        transport: How it is reached.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def _ask(self, method: str, path: str, **options: Any) -> Record:
        return Record(self._transport.request(method, path, **options).json())

    def _items(self, path: str, params: Mapping[str, Any] | None = None, limit: int | None = None) -> Records:
        return Records(self._transport.items(path, params, limit))


def segment(text: str) -> str:
    """A part of a path that cannot become several.

    Raises:
        Problem: It is none.
    """
    if not text or text in (".", "..") or not all(c.isascii() and (c.isalnum() or c in "-._") for c in text):
        raise Problem(f"'{text}' is not a name or id.", "Copy it from the output of the list command.")
    return text
