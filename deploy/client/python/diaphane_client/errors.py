"""What can go wrong; every text says what is wrong and ends with what to do."""

from __future__ import annotations


class PullError(Exception):
    """A bundle could not be fetched; one that was fetched before is still there.

    Args:
        what: What is wrong, one sentence.
        remedy: What to do about it, one sentence.
    """

    def __init__(self, what: str, remedy: str) -> None:
        super().__init__(f"{what} {remedy}")
        self.what = what
        self.remedy = remedy


class Refused(PullError):
    """A hash, a signature, a key, a version or a manifest is not what it must be."""


class Unavailable(PullError):
    """The server cannot be reached, or cannot answer now."""


class Denied(PullError):
    """The server does not accept the key."""


class NotFound(PullError):
    """The server has no such model, version, alias or file."""
