"""What was seen of servers and bundles, and what may follow it: rules without files, clocks or networks.

Rules for a pointer, a signed statement of what an alias means:
- it is about the name and the alias that were asked for;
- its key is the one that the server had, and that the name had, or these handed over to it, each to the next one; the
  first one that is seen is believed, or else the one that was given; a key that handed over is never believed again;
- it is not expired, by this machine's clock, or by the latest statement that was seen where that is later;
- the number of the alias's last move is not lower than it was, whichever key signed; the same number means the same;
- a version never has other files than it had before;
- an alias may go back to an older version, by a move with a higher number; but not with a key that was given by hand
  and that the old one did not hand over to.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Final

from diaphane_client.errors import Refused
from diaphane_client.pointer import Pointer, version_order

SKEW_SECONDS: Final = 300
"""How far the clocks of a server and a client may differ."""
MAX_LIFETIME_SECONDS: Final = 86_400
"""A statement that holds for longer is refused: it could be served for ever."""

_ASK = "Ask who runs the server: it may be misconfigured, or somebody may have tampered with it."


@dataclass(frozen=True)
class Mark:
    """What an alias, or a version itself, meant when it was asked for last.

    Attributes:
        serial: Number of the alias's last move.
        version: What it meant.
        issued: When that was signed, seconds since 1970; of statements that say the same, not always the last one.
    """

    serial: int
    version: str
    issued: int


@dataclass(frozen=True)
class Seen:
    """What was seen of a name.

    Attributes:
        key: Public key of the last statement, base64.
        marks: Alias or version -> what it meant.
        versions: Version -> digest, of all that were ever pointed at.
    """

    key: str
    marks: Mapping[str, Mark]
    versions: Mapping[str, str]

    @property
    def highest(self) -> str:
        """The highest version that was ever seen."""
        return max(self.versions, key=version_order)

    @property
    def latest(self) -> int:
        """When the latest statement was signed, seconds since 1970."""
        return max(mark.issued for mark in self.marks.values())


@dataclass(frozen=True)
class Trust:
    """What was seen of all servers and names.

    Attributes:
        servers: URL -> public key, base64.
        names: Name -> what was seen of it; None: forgotten on purpose.
        retired: Public keys that handed over to others.
    """

    servers: Mapping[str, str] = field(default_factory=dict)
    names: Mapping[str, Seen | None] = field(default_factory=dict)
    retired: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Question:
    """What was asked for.

    Attributes:
        server: URL.
        name: Name of the bundle.
        selector: Alias or version.
        public_key: Key that was given by hand, base64; None: that which was seen.
    """

    server: str
    name: str
    selector: str
    public_key: str | None = None


def advance(trust: Trust, asked: Question, pointer: Pointer, now: float) -> Trust:
    """What is known once a pointer is believed.

    Args:
        trust: What was known before.
        asked: What the pointer answers.
        pointer: Its signatures hold.
        now: Of this machine's clock, seconds since 1970.

    Returns:
        What is to be kept; the very `trust` if nothing of weight is new.

    Raises:
        Refused: The pointer is not to be believed.
    """
    seen = trust.names.get(asked.name)
    _check_subject(asked, pointer)
    is_handed_over = _check_key(trust, seen, asked, pointer)
    _check_time(seen, pointer, now)
    if seen:
        _check_order(seen, asked, pointer, is_handed_over)
    return _kept(trust, seen, asked, pointer)


def is_vouched(trust: Trust, asked: Question) -> bool:
    """Whether what was seen of a name is what the server that is asked stands for, as far as its key tells."""
    seen, key = trust.names.get(asked.name), asked.public_key or trust.servers.get(asked.server)
    return seen is not None and (key == seen.key or key in trust.retired)


def forget(trust: Trust, name: str) -> Trust:
    """What is known when a name is to be as if it had never been seen."""
    return replace(trust, names={**trust.names, name: None})


def _check_subject(asked: Question, pointer: Pointer) -> None:
    if (pointer.name, pointer.selector) != (asked.name, asked.selector):
        raise Refused(
            f"The server's statement is about '{pointer.name}' {pointer.selector}, "
            f"not about '{asked.name}' {asked.selector}.",
            _ASK,
        )
    if version_order(asked.selector) and pointer.version != asked.selector:
        raise Refused(f"The server has {pointer.version} for '{asked.name}' {asked.selector}.", _ASK)


def _check_key(trust: Trust, seen: Seen | None, asked: Question, pointer: Pointer) -> bool:
    """Whether the keys that were seen handed over to the pointer's, or there were none."""
    name, key = asked.name, pointer.public_key
    if key in trust.retired:
        raise Refused(
            f"'{name}' is signed with the key {key}, which was handed over to another one.",
            "Ask who runs the server: it may not use its new key everywhere, or the old one was stolen.",
        )
    given = asked.public_key
    if given is not None and given not in pointer.keys:
        raise Refused(
            f"'{name}' is signed with the key {key}, which is not the one that was given, {given}.",
            "Compare the key with GET /v1/signing-keys of the server, over a channel that you trust.",
        )
    known = {found for found in (trust.servers.get(asked.server), seen.key if seen else None) if found}
    strangers = known - set(pointer.keys)
    if strangers and (given is None or given in trust.retired):
        raise Refused(
            f"'{name}' is signed with the key {key}, to which the trusted one, {min(strangers)}, did not hand over.",
            "If the server's key was changed on purpose, give the new one as public_key once; another server with the "
            "same name of a bundle needs a folder of its own.",
        )
    return not strangers


def _check_time(seen: Seen | None, pointer: Pointer, now: float) -> None:
    what = f"The statement of what '{pointer.name}' {pointer.selector} means"
    if pointer.issued > now + SKEW_SECONDS:
        raise Refused(
            f"{what} is of {moment(pointer.issued)}, which is yet to come: it is {moment(now)} here.",
            "Set the clock of this machine, or of the server.",
        )
    if not 0 < pointer.expires - pointer.issued <= MAX_LIFETIME_SECONDS:
        raise Refused(f"{what} holds until {moment(pointer.expires)}, which is too long.", _ASK)
    if pointer.expires + SKEW_SECONDS <= now:
        raise Refused(
            f"{what} expired at {moment(pointer.expires)}, and it is {moment(now)}.",
            "Set the clock of this machine; if it is right, something on the way to the server serves old answers.",
        )
    # A clock that was set back must not make an old statement a new one.
    if seen and pointer.expires + SKEW_SECONDS <= seen.latest:
        raise Refused(
            f"{what} expired at {moment(pointer.expires)}, and one of {moment(seen.latest)} was seen here.",
            "Set the clock of this machine; if it is right and the server's was wrong then, call "
            f"diaphane_client.forget('{pointer.name}', folder=...).",
        )


def _check_order(seen: Seen, asked: Question, pointer: Pointer, is_handed_over: bool) -> None:
    name, selector, version = pointer.name, pointer.selector, pointer.version
    if seen.versions.get(version, pointer.digest) != pointer.digest:
        raise Refused(
            f"'{name}' {version} has other files than it had before.",
            "Versions never change: ask who runs the server, and give another server a folder of its own.",
        )
    before = seen.marks.get(selector)
    if before and pointer.serial < before.serial:
        raise Refused(
            f"The server's statement of what '{name}' {selector} means is older than one that was seen here: "
            f"{version}, where it was {before.version} later.",
            "Something may serve old answers; if the server's database was restored, move the alias once there.",
        )
    if before and pointer.serial == before.serial and version != before.version:
        raise Refused(f"The server says that '{name}' {selector} is {version} and {before.version} at once.", _ASK)
    if not is_handed_over and not version_order(selector) and version_order(version) < version_order(seen.highest):
        raise Refused(
            f"With the key {pointer.public_key}, '{name}' {selector} would go back from {seen.highest} to {version}.",
            f"If that is right, call diaphane_client.forget('{name}', folder=...) first.",
        )


def _kept(trust: Trust, seen: Seen | None, asked: Question, pointer: Pointer) -> Trust:
    mark = Mark(pointer.serial, pointer.version, pointer.issued)
    if before := seen.marks.get(asked.selector) if seen else None:
        mark = replace(mark, issued=max(mark.issued, before.issued))
        is_same = (before.serial, before.version) == (mark.serial, mark.version)
        if is_same and mark.issued < before.issued + SKEW_SECONDS:
            mark = before  # not written down at every question
    after = Seen(
        key=pointer.public_key,
        marks={**(seen.marks if seen else {}), asked.selector: mark},
        versions={**(seen.versions if seen else {}), pointer.version: pointer.digest},
    )
    made = Trust(
        servers={**trust.servers, asked.server: pointer.public_key},
        names={**trust.names, asked.name: after},
        retired=trust.retired | set(pointer.keys[:-1]),
    )
    return trust if made == trust else made


def moment(seconds: float) -> str:
    """A time for people: `2026-03-01 12:00:00 UTC`."""
    return datetime.fromtimestamp(min(seconds, 253_402_300_799), UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
