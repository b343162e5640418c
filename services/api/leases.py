"""Answers that take long end with the key, and the session, that they were begun with.

Rules:
- one query a second for all answers under way of a process, so that revoking holds for every process within two;
- who listens to events holds a place: there are so many, and a key has a part of them;
- while the database is away nobody can tell who is alive: what is under way goes on, since no event can be read either,
  but for streams of pages, so that the page asks and says what is wrong.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import anyio
import structlog
from anyio import to_thread
from starlette.types import Scope

from services.problems import Refusal

LOOK_SECONDS = 1.0
"""Between two looks for what has ended."""

LISTENERS = 1000
"""Who listen to events of one process at most."""

LISTENERS_PER_KEY = 100
"""Of one key, sessions included."""

_LATER = {"Retry-After": "15"}

log = structlog.get_logger("diaphane.leases")

Alive = Callable[[Collection[str]], set[str]]
"""Tells which of some ids are valid now."""


@dataclass(frozen=True)
class Holder:
    """What an answer is given for.

    Attributes:
        key_id: Id of the key.
        session: Hash of the session's token; empty: the key itself was sent.
    """

    key_id: str
    session: str = ""


@dataclass(eq=False)
class _Lease:
    holder: Holder
    end: Callable[[], None]
    ends_in_doubt: bool


class Leases:
    """The answers under way of a process that take long.

    Args:
        keys: Tells which keys are valid.
        sessions: Tells which sessions are.
        look: Seconds between two looks.
    """

    def __init__(self, keys: Alive, sessions: Alive, look: float = LOOK_SECONDS) -> None:
        self._keys, self._sessions, self._look = keys, sessions, look
        self._held: set[_Lease] = set()
        self._listeners: Counter[str] = Counter()
        self._watcher: asyncio.Task[None] | None = None
        self._thread = anyio.CapacityLimiter(1)  # of its own: those of the requests may all be busy

    @property
    def listeners(self) -> int:
        """How many listen now."""
        return self._listeners.total()

    @contextmanager
    def listen(self, holder: Holder) -> Iterator[None]:
        """While somebody listens; taken before the answer begins, so that of many at once none is too many.

        Raises:
            Refusal: Too many listen already, in all or with this key.
        """
        if self._listeners[holder.key_id] >= LISTENERS_PER_KEY:
            detail = f"The key listens to {LISTENERS_PER_KEY} streams of events already, as many as a key may."
            raise Refusal("too-many-requests", detail, "End some of them, then try again.", headers=_LATER)
        if self.listeners >= LISTENERS:
            raise Refusal("unavailable", f"{LISTENERS} listeners are connected already.")
        self._listeners[holder.key_id] += 1
        try:
            yield
        finally:
            self._listeners[holder.key_id] -= 1
            if not self._listeners[holder.key_id]:
                del self._listeners[holder.key_id]

    @contextmanager
    def hold(self, holder: Holder, end: Callable[[], None], *, ends_in_doubt: bool = False) -> Iterator[None]:
        """While an answer is under way.

        Args:
            holder: Whom it is for.
            end: Called when that is not valid any more.
            ends_in_doubt: Also when nobody can tell.
        """
        lease = _Lease(holder, end, ends_in_doubt)
        self._held.add(lease)
        self._watch()
        try:
            yield
        finally:
            self._held.discard(lease)

    def _watch(self) -> None:
        loop, watcher = asyncio.get_running_loop(), self._watcher
        if watcher is None or watcher.done() or watcher.get_loop() is not loop:
            self._watcher = loop.create_task(self._end_the_ended())

    async def _end_the_ended(self) -> None:
        """Runs while anything is held."""
        while self._held:
            await asyncio.sleep(self._look)
            holders = {lease.holder for lease in self._held}
            ended: set[Holder] | None
            try:
                ended = await to_thread.run_sync(self._ended, holders, limiter=self._thread)
            except Exception as error:  # whatever it is, the next look must come
                log.warning("keys cannot be read", error=type(error).__name__)
                ended = None
            for lease in list(self._held):
                if lease.ends_in_doubt if ended is None else lease.holder in ended:
                    lease.end()

    def _ended(self, holders: set[Holder]) -> set[Holder]:
        if not holders:
            return set()
        keys = self._keys({holder.key_id for holder in holders})
        sessions = self._sessions({holder.session for holder in holders if holder.session})
        return {
            holder
            for holder in holders
            if holder.key_id not in keys or (holder.session and holder.session not in sessions)
        }


@contextmanager
def revocable(scope: Scope, *, ends_in_doubt: bool = False) -> Iterator[None]:
    """What is left, as if cancelled, when the key or session of a request ends.

    Args:
        scope: Of the request (ASGI); where nobody is signed in, nothing can end.
        ends_in_doubt: Whether it is left as well when nobody can tell.
    """
    holder: Holder | None = scope.get("state", {}).get("holder")
    with anyio.CancelScope() as left:
        if holder is None:
            yield
            return
        leases: Leases = scope["app"].state.leases
        with leases.hold(holder, left.cancel, ends_in_doubt=ends_in_doubt):
            yield
