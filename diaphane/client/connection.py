"""A connection to a server, as all that asks one opens it.

Rules:
- a redirect is not followed, so that the key goes to this server only;
- the key is in one header and nowhere else;
- a proxy of the environment is not asked for this machine's own loopback, which it cannot reach;
- the trusted authorities are read once, since that takes longer than a short question.
"""

from __future__ import annotations

import ssl
from collections.abc import Mapping
from functools import cache
from urllib.parse import urlsplit

import httpx

LOOPBACK = ("127.0.0.1", "localhost", "::1")


class BadUrl(ValueError):
    """What is wrong with the URL of a server, and what to do."""

    def __init__(self, what: str, remedy: str) -> None:
        super().__init__(f"{what} {remedy}")
        self.what, self.remedy = what, remedy


class BadKey(ValueError):
    """The key cannot be one."""


def connect(url: str, key: str | None, timeout: httpx.Timeout | float, headers: Mapping[str, str]) -> httpx.Client:
    """A client of the server at a URL, which paths are asked of.

    Args:
        url: `http://host:port` or `https://...`, with a path if the server lies under one.
        key: API key, perhaps with a line feed behind it, as files of keys end; None: requests go without.
        timeout: Of connections, seconds.
        headers: Beside the key, of every request.

    Raises:
        BadUrl: The URL is not one, or carries a password.
        BadKey: The key is not one word.
    """
    address, secret, named = checked_url(url), (key or "").strip(), dict(headers)
    if secret:
        if not (secret.isascii() and secret.isprintable()) or " " in secret:
            raise BadKey("The key is not one.")
        named["Authorization"] = f"Bearer {secret}"
    return httpx.Client(
        base_url=address,
        headers=named,
        timeout=timeout,
        follow_redirects=False,
        trust_env=urlsplit(address).hostname not in LOOPBACK,
        verify=_authorities(),
    )


def checked_url(url: str) -> str:
    """A server's URL, without a slash at its end.

    Raises:
        BadUrl: It is none, or carries a password.
    """
    try:
        parts = urlsplit(url)
        good = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        good = False
    if not good or parts.query or parts.fragment:
        raise BadUrl(
            "The server's URL is not valid.", "Write it like http://127.0.0.1:8035 or https://diaphane.example."
        )
    if parts.username is not None or parts.password is not None:
        raise BadUrl("The server's URL contains a password.", "Put the key into DIAPHANE_KEY, not into the URL.")
    return url.rstrip("/")


@cache
def _authorities() -> ssl.SSLContext:
    return httpx.create_ssl_context()
