"""What an alias means now, as the server states it: signed, and for a short time.

What is here was read and its signatures hold; whether its key, its time and its number are to be believed is decided
in `trust`.
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from diaphane_client.errors import Refused
from diaphane_client.signatures import is_signed

POINTER_FORMAT: Final = "diaphane-pointer/1"
HANDOVER_FORMAT: Final = "diaphane-handover/1"
MAX_POINTER_BYTES: Final = 1 << 16
MAX_HANDOVERS: Final = 64

_VERSION = re.compile(r"\.".join(3 * [r"(0|[1-9][0-9]{0,5})"]))
_DIGEST = re.compile(r"[0-9a-f]{64}")
_MAX_NUMBER = 1 << 53
_TEXTS = ("name", "selector", "version", "digest")
_NUMBERS = ("serial", "issued", "expires")


@dataclass(frozen=True)
class Pointer:
    """What an alias means.

    Attributes:
        name: Name of the bundle.
        selector: Alias, or the version itself.
        version: What it means.
        digest: Hex sha256 over the names and hashes of that version's files.
        serial: Number of the alias's last move; 0 for a version.
        issued: When it was signed, seconds since 1970.
        expires: When it ends to hold, seconds since 1970.
        keys: Public keys, base64, each of which handed over to the next; the last one signed this.
    """

    name: str
    selector: str
    version: str
    digest: str
    serial: int
    issued: int
    expires: int
    keys: tuple[str, ...]

    @property
    def public_key(self) -> str:
        """The key that signed it."""
        return self.keys[-1]


def version_order(version: str) -> tuple[int, ...]:
    """A semantic version as numbers; empty if it is none."""
    found = _VERSION.fullmatch(version)
    return tuple(map(int, found.groups())) if found else ()


def parse_pointer(content: bytes) -> Pointer:
    """Reads a server's answer, and checks its signatures.

    Raises:
        Refused: It is not a pointer, or one of its signatures is wrong.
    """
    try:
        answer = json.loads(content)
        statement, signature, public_key = (_text(answer[name]) for name in ("statement", "signature", "public_key"))
        signed = is_signed(public_key, statement, signature)
        keys = [_handover(each) for each in answer["handovers"]]
        if not signed or len(keys) > MAX_HANDOVERS or any(before[1] != after[0] for before, after in pairwise(keys)):
            raise ValueError("a signature is wrong, or a key is missing")
        if keys and keys[-1][1] != public_key:
            raise ValueError("the handovers lead to another key")
        said = json.loads(statement)
        if set(said) != {"format", *_TEXTS, *_NUMBERS} or said["format"] != POINTER_FORMAT:
            raise ValueError("it is another statement")
        name, selector, version, digest = (_text(said[each]) for each in _TEXTS)
        serial, issued, expires = (_number(said[each]) for each in _NUMBERS)
        if not version_order(version) or not _DIGEST.fullmatch(digest):
            raise ValueError("there is no version, or no digest")
        row = (*(old for old, _ in keys), public_key)
        return Pointer(name, selector, version, digest, serial, issued, expires, row)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise Refused(
            "The server's statement of what the alias means is not one, or its signature is wrong.",
            "Check the URL; if it is right, ask who runs the server whether somebody may have tampered with it.",
        ) from error


def _handover(record: Any) -> tuple[str, str]:
    """The old and the new key of a handover that the old one signed."""
    said = json.loads(_text(record["statement"]))
    old, new = _text(said["from"]), _text(said["to"])
    if said["format"] != HANDOVER_FORMAT or not is_signed(old, record["statement"], _text(record["signature"])):
        raise ValueError("a handover is not signed")
    return old, new


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError("a text is not one")
    return value


def _number(value: Any) -> int:
    if type(value) is not int or not 0 <= value < _MAX_NUMBER:
        raise TypeError("a number is not one")
    return value
