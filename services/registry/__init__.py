"""Published bundles: immutable signed versions, movable aliases with their history.

What needs a database is imported when it is first asked for: the records are wanted by commands that have none.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from services.registry.records import CANDIDATE, CHAMPION, PUBLICATION, Aliases, Move, Publication

if TYPE_CHECKING:
    from services.registry.registry import Registry, open_registry
    from services.registry.signing import Signer

_LATE = {
    "Registry": "services.registry.registry",
    "Signer": "services.registry.signing",
    "open_registry": "services.registry.registry",
}

__all__ = [
    "CANDIDATE",
    "CHAMPION",
    "PUBLICATION",
    "Aliases",
    "Move",
    "Publication",
    "Registry",
    "Signer",
    "open_registry",
]


def __getattr__(name: str) -> Any:
    if name in _LATE:
        return getattr(import_module(_LATE[name]), name)
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
