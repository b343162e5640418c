"""`If-None-Match`: whoever has an answer need not be sent it again."""

from __future__ import annotations

from fastapi import Request


def is_current(request: Request, tag: str) -> bool:
    """Whether `If-None-Match` names an answer; weak comparison, as RFC 9110 has it for this header.

    Args:
        request: The request.
        tag: The answer's ETag, without its quotes.
    """
    tags = [each.strip().removeprefix("W/") for each in request.headers.get("if-none-match", "").split(",")]
    return "*" in tags or f'"{tag}"' in tags
