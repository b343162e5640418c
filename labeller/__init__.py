"""Error curves of every pixel, certified optimal allocations, the rules they are compared with, and label shards.

`labeller.allocate` is all of it as one function of plain numpy arrays.
"""

from labeller.allocation import RULES, Allocation, RuleName
from labeller.api import allocate

__all__ = ["RULES", "Allocation", "RuleName", "allocate"]
