"""What was seen of servers and bundles, as `trust.json` keeps it."""

from __future__ import annotations

import json
import re
from typing import Any, Final

from diaphane_client.pointer import version_order
from diaphane_client.trust import Mark, Seen, Trust

TRUST_FORMAT: Final = "diaphane-trust/1"

_KEY = re.compile(r"[A-Za-z0-9+/]{43}=")


def dump_trust(trust: Trust) -> str:
    """What `parse_trust` reads back."""
    names = {
        name: seen
        and {
            "key": seen.key,
            "versions": dict(seen.versions),
            "marks": {selector: dict(mark.__dict__) for selector, mark in seen.marks.items()},
        }
        for name, seen in trust.names.items()
    }
    content = {"format": TRUST_FORMAT, "servers": dict(trust.servers), "retired": sorted(trust.retired), "names": names}
    return json.dumps(content, indent=2, sort_keys=True)


def parse_trust(content: bytes) -> Trust:
    """Reads what was kept.

    Raises:
        ValueError: It is not what `dump_trust` writes.
    """
    try:
        found = json.loads(content)
        if set(found) != {"format", "servers", "retired", "names"} or found["format"] != TRUST_FORMAT:
            raise ValueError("the format is another one")
        return Trust(
            servers={server: _key(key) for server, key in found["servers"].items()},
            names={name: None if seen is None else _seen(seen) for name, seen in found["names"].items()},
            retired=frozenset(_key(key) for key in found["retired"]),
        )
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("it is not what was written") from error


def _seen(found: dict[str, Any]) -> Seen:
    marks = {selector: _mark(**mark) for selector, mark in found["marks"].items()}
    versions: dict[str, str] = dict(found["versions"])
    if not marks or not {mark.version for mark in marks.values()} <= set(versions):
        raise ValueError("a version is missing")
    if not all(version_order(version) and isinstance(digest, str) for version, digest in versions.items()):
        raise ValueError("a version is not one")
    return Seen(_key(found["key"]), marks, versions)


def _mark(serial: int, version: str, issued: int) -> Mark:
    if type(serial) is not int or type(issued) is not int:
        raise TypeError("a number is not one")
    return Mark(serial, version, issued)


def _key(found: Any) -> str:
    if not isinstance(found, str) or not _KEY.fullmatch(found):
        raise TypeError("a key is not one")
    return found
