"""Numbers with their nouns."""

from __future__ import annotations

import re

_PLURAL = re.compile(r"(?<=sh)es\b|s\b")


def counted(count: int, things: str) -> str:
    """A number with what it counts, as `1 view`, `1,200 views already captured`.

    Args:
        count: How many.
        things: The plural; its first word that ends in s is the noun, whose singular lacks the s, or the es of meshes.
    """
    return f"{count:,} {_PLURAL.sub('', things, count=1) if count == 1 else things}"
