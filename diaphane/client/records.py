"""What a server answers: plain JSON values that show themselves in notebooks.

A newer server may say more than this client knows, so nothing of an answer is left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from diaphane import shown

_HEADINGS: Final = ("id", "name", "kind", "state", "fraction", "latest", "version", "score", "created")
"""Fields that tell records apart, in the order of their columns; a table has those that its records have."""


class Record(dict[str, Any]):
    """One thing of a server."""

    def _repr_html_(self) -> str:
        title = str(self.get("id") or self.get("name") or "")
        return shown.facts(title, ((name, _short(value)) for name, value in self.items()))


class Records(list[Record]):
    """Several things of one kind.

    Args:
        found: JSON objects.
    """

    def __init__(self, found: Iterable[dict[str, Any]]) -> None:
        super().__init__(map(Record, found))

    def _repr_html_(self) -> str:
        names = [name for name in _HEADINGS if any(name in one for one in self)]
        return shown.table(names, ([one.get(name) for name in names] for one in self))


def _short(value: Any) -> Any:
    """A value as a table has it: of what holds others, how many."""
    if isinstance(value, dict | list):
        return f"{len(value)} {'entries' if isinstance(value, dict) else 'items'}" if value else None
    return value
