"""What a licence says about commercial use, as far as its words tell; nothing here is legal advice."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Final, Literal

Use = Literal["allowed", "forbidden", "unknown"]

MOST_CHARACTERS: Final = 500
"""Of a licence with its attribution: more is cut off."""

_FORBIDDEN: Final = re.compile(
    r"\bnc\b|non-?\s?commercial|personal use|editorial|(?:academic|educational|research) (?:use|purposes) only", re.I
)
_UNDECIDED: Final = re.compile(
    r"none stated|no further terms|from memory|unknown|unclear|\bsa\b|share-?\s?alike|\bnd\b|no-?\s?deriv|gpl", re.I
)
"""Nothing is stated for sure, or there are terms for what is made of a work, which a network may be."""
_ALLOWED: Final = re.compile(
    r"\bcc-?\s?0\b|\bcc-?\s?by\b|creative commons (?:zero|attribution)|\bmit\b|\bapache\b|\bbsd\b|\bisc\b|\bzlib\b|"
    r"\bunlicense\b|public domain|tomorrow open source",
    re.I,
)
_FAULTS: Final[Mapping[Use, str]] = {
    "forbidden": "forbid it by their licence",
    "unknown": "have no licence that is known to allow it",
}


def commercial_use(licence: str) -> Use:
    """Whether what a scene's licence says allows commercial use.

    Args:
        licence: Its words, perhaps with the attribution; empty: none is known.

    Returns:
        `unknown` where none is stated or recognised, or its terms depend on what is made of the work.
    """
    if _FORBIDDEN.search(licence):
        return "forbidden"
    if _UNDECIDED.search(licence) or not _ALLOWED.search(licence):
        return "unknown"
    return "allowed"


def verdict(scenes: Iterable[str], licences: Mapping[str, str]) -> str:
    """Whether a network may be used commercially as far as its training scenes go, in one sentence.

    Args:
        scenes: Names of all training scenes.
        licences: Scene -> its licence; a scene without one has none that is known.
    """
    uses = {scene: commercial_use(licences.get(scene, "")) for scene in sorted(scenes)}
    count, faults = len(uses), []
    for use, words in _FAULTS.items():
        found = [scene for scene in uses if uses[scene] == use]
        if found:
            faults.append(f"{len(found)} of {count} training scenes {words} ({', '.join(found)})")
    if not faults:
        return f"Commercial use is allowed by the licences of all {count} training scenes."
    return f"Commercial use is NOT CLEARED: {'; '.join(faults)}."


def tidy(text: str) -> str:
    """A licence on one line without control characters, of at most `MOST_CHARACTERS`."""
    words = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    return words if len(words) <= MOST_CHARACTERS else words[: MOST_CHARACTERS - 1] + "…"
