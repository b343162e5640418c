"""`If-None-Match`: whoever has an answer need not be sent it again."""

from __future__ import annotations


def is_current(header: str | None, tag: str) -> bool:
    """Whether `If-None-Match` names an answer; weak comparison, as RFC 9110 has it for this header.

    Args:
        header: The header; None: there is none.
        tag: The answer's ETag, without its quotes.
    """
    tags = [each.strip().removeprefix("W/") for each in (header or "").split(",")]
    return "*" in tags or f'"{tag}"' in tags
