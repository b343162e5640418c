"""Error curves of every pixel, certified optimal allocations, the rules they are compared with, and label shards.

`labeller.allocate` is all of it as one function of plain numpy arrays.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from labeller.allocation import RULES, Allocation, RuleName
    from labeller.api import allocate

__all__ = ["RULES", "Allocation", "RuleName", "allocate"]


def __getattr__(name: str) -> Any:
    # On first use: numpy starts threads, and a process that shuts itself in imports packages while it must have none.
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("labeller.api" if name == "allocate" else "labeller.allocation"), name)
