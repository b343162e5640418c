"""Who asks, and whether they may: a default dependency of the root router, and scopes of single routes."""

from __future__ import annotations

import ipaddress
import math
from collections.abc import Callable
from typing import Annotated

from fastapi import Depends, Request

from schemas.service import KeyRecord, Scope
from services.api.leases import Holder
from services.api.ledger import Ledger
from services.api.rate import Allowance, Buckets
from services.database import Database
from services.keys import Found, Keys, allows
from services.problems import Refusal

_FAILURES_PER_BURST = 4
_NETWORK = 64
"""Bits of an IPv6 address that one user has: a home or a machine is given all that are left."""


class Guard:
    """Authenticates requests; the default dependency of every route that is not on the short list of open ones.

    Whoever is right is never refused for what others at the same address got wrong: secrets have 256 random bits, so
    that counting failures protects no key. It only tells a client that guesses to stop.

    Args:
        keys: The keys.
        rate: Requests a second of a key, on average.
        burst: Requests of a key at once. An address may guess a quarter as often.
        database: What the processes of a service settle both through.
    """

    def __init__(self, keys: Keys, rate: float, burst: int, database: Database) -> None:
        self._keys = keys
        self.requests = Buckets(rate, burst, Ledger(database, "key"))
        guesses = max(1, burst // _FAILURES_PER_BURST)
        self.failures = Buckets(rate / _FAILURES_PER_BURST, guesses, Ledger(database, "address"))

    def __call__(self, request: Request) -> KeyRecord:
        """The key of a request, also in `request.state.key`.

        Raises:
            Refusal: It has no valid key, or the key or the address asks too often.
        """
        scheme, _, secret = request.headers.get("authorization", "").partition(" ")
        secret = secret.strip() if scheme.lower() == "bearer" else ""
        key = self.admit(request, secret, self._keys.authenticate)
        if key is None:
            error = ', error="invalid_token"' if secret else ""
            challenge = {"WWW-Authenticate": f'Bearer realm="diaphane"{error}'}
            raise Refusal(
                "unauthenticated",
                "The key is unknown, expired or revoked." if secret else "The request has no key.",
                headers=challenge,
            )
        if request.method in ("GET", "HEAD"):
            require_scope(key, "read")
        return key

    def admit(self, request: Request, secret: str, find: Callable[[str], Found], session: str = "") -> KeyRecord | None:
        """The key that a secret stands for, also in `request.state.key`; None if it stands for none.

        Args:
            request: The request.
            secret: A key's secret or a session's token; empty: none was sent.
            find: Tells what a secret stands for.
            session: What is kept of a session's token; empty: it is a key's secret.

        Raises:
            Refusal: The key asks too often, or the address guesses too often.
        """
        found = find(secret) if secret else Found(None)
        if found.is_guess:
            _require(self.failures.take(address_of(request)), "This address sent too many keys that there are not.")
        key = found.key
        if key is None:
            return None
        allowance = self.requests.take(key.id)
        request.state.allowance = allowance
        _require(allowance, f"The key may send {self.requests.rate:g} requests a second on average.")
        request.state.key, request.state.holder = key, Holder(key.id, session)
        return key

    def settle(self) -> None:
        """Writes down what this process alone knows of who has sent how much."""
        self.requests.settle()
        self.failures.settle()


class Needs:
    """A dependency: the key must have a scope.

    Args:
        scope: The scope.
    """

    def __init__(self, scope: Scope) -> None:
        self.scope = scope

    async def __call__(self, request: Request) -> None:
        """Refuses a key without the scope.

        Raises:
            Refusal: It has not got it.
        """
        require_scope(request.state.key, self.scope)


def require_scope(key: KeyRecord, scope: Scope) -> None:
    """Refuses a key without a scope.

    Raises:
        Refusal: It has not got it.
    """
    if not allows(key, scope):
        raise Refusal("forbidden", f"The key {key.id} lacks the scope '{scope}'.")


def is_own(key: KeyRecord, made_by: str) -> bool:
    """Whether a key may change what another request made: its own, or everything with the scope `admin`."""
    return made_by == key.id or allows(key, "admin")


def require_own(key: KeyRecord, made_by: str, what: str) -> None:
    """Refuses a key that would change what another key made.

    Args:
        key: The key.
        made_by: Id of the key that made it.
        what: What it is, to be told.

    Raises:
        Refusal: It belongs to another key.
    """
    if not is_own(key, made_by):
        raise Refusal("not-own", f"{what} belongs to another key than {key.id}.")


def address_of(request: Request) -> str:
    """Whom an address stands for: itself, or of IPv6 the network that one user has."""
    text = request.client.host if request.client else ""
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return text[:64]
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(ipaddress.ip_network((address, _NETWORK), strict=False))


async def _key_of(request: Request) -> KeyRecord:
    key: KeyRecord = request.state.key
    return key


Caller = Annotated[KeyRecord, Depends(_key_of)]
"""The key of the request, where a handler wants to know it."""


def _require(allowance: Allowance, detail: str) -> None:
    if not allowance.allowed:
        raise Refusal("too-many-requests", detail, headers={"Retry-After": str(max(1, math.ceil(allowance.wait)))})
