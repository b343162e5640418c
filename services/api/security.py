"""Who asks, and whether they may: a default dependency of the root router, and scopes of single routes."""

from __future__ import annotations

import hashlib
import math
from collections import OrderedDict
from collections.abc import Callable
from typing import Annotated

from fastapi import Depends, Request

from schemas.service import KeyRecord, Scope
from services.api.rate import Allowance, Buckets
from services.keys import Keys, allows
from services.problems import Refusal

_KNOWN = 10_000
_FAILURES_PER_BURST = 4


class Guard:
    """Authenticates requests; the default dependency of every route that is not on the short list of open ones.

    Args:
        keys: The keys.
        rate: Requests a second of a key, on average.
        burst: Requests of a key at once. An address may be wrong a quarter as often.
    """

    def __init__(self, keys: Keys, rate: float, burst: int) -> None:
        self._keys = keys
        self.requests = Buckets(rate, burst)
        self.failures = Buckets(rate / _FAILURES_PER_BURST, max(1, burst // _FAILURES_PER_BURST))
        self._known: OrderedDict[str, None] = OrderedDict()

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

    def admit(self, request: Request, secret: str, find: Callable[[str], KeyRecord | None]) -> KeyRecord | None:
        """The key that a secret stands for, also in `request.state.key`; None if it stands for none.

        Args:
            request: The request.
            secret: A key's secret or a session's token; empty: none was sent.
            find: Tells the key of a secret.

        Raises:
            Refusal: The key, or the address with secrets that stand for none, asks too often.
        """
        address = request.client.host if request.client else ""
        name = hashlib.sha256(secret.encode("utf-8", "surrogatepass")).hexdigest()
        # An address that was wrong too often is not heard any more, but for keys that were right before: others may
        # share the address.
        if name not in self._known:
            _require(self.failures.take(address, 0.0), "This address sent too many wrong keys.")
        key = find(secret) if secret else None
        if key is None:
            self._known.pop(name, None)
            self.failures.take(address)
            return None
        self._remember(name)
        allowance = self.requests.take(key.id)
        request.state.allowance = allowance
        _require(allowance, f"The key may send {self.requests.rate:g} requests a second on average.")
        request.state.key = key
        return key

    def _remember(self, name: str) -> None:
        self._known[name] = None
        if len(self._known) > _KNOWN:
            self._known.popitem(last=False)


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


async def _key_of(request: Request) -> KeyRecord:
    key: KeyRecord = request.state.key
    return key


Caller = Annotated[KeyRecord, Depends(_key_of)]
"""The key of the request, where a handler wants to know it."""


def _require(allowance: Allowance, detail: str) -> None:
    if not allowance.allowed:
        raise Refusal("too-many-requests", detail, headers={"Retry-After": str(max(1, math.ceil(allowance.wait)))})
