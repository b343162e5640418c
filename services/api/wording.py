"""What is wrong with a field of a request, in words: what is allowed there, never what was sent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

LENGTH: Final = 200
"""Characters of a place, and of what is said of it."""

_PLACES: Final[Mapping[str, str]] = {
    "query": "in the address",
    "path": "in the address",
    "form": "in the form",
    "body": "in the body",
    "header": "among the headers",
    "cookie": "among the cookies",
}

PATTERNS: Final[Mapping[str, str]] = {
    r"^[^\x00-\x1f\x7f]*$": "text of one line without control characters",
    r"^[!-~]+$": "printable ASCII without spaces",
    r"^https?://[\x21-\x7e]+$": "an address that begins with http:// or https://, in ASCII without spaces",
    r"^[0-9]{0,5}$": "a whole number of at most five digits, or empty",
    r"^[0-9a-f]{64}$": "a sha256: 64 hex digits in small letters",
    r"^[0-9a-f]{0,16}$": "what the page was given: at most 16 hex digits",
    r"^job_[0-9a-f]{24}$": "the id of a job: job_ and 24 hex digits",
    r"^scn_[0-9a-f]{32}$": "the id of a scene: scn_ and 32 hex digits",
    r"^(?:scn_[0-9a-f]{32}|[0-9a-f]{64})?$": "a scene: its id, scn_ and 32 hex digits, or its digest, or empty",
    r"^dst_[0-9a-f]{32}$": "the id of a data set: dst_ and 32 hex digits",
    r"^[a-z]{1,32}$": "1 to 32 small letters",
    r"^[a-z]{0,32}$": "at most 32 small letters",
    r"^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?$": "a name: 1 to 63 small letters, digits and inner hyphens",
    r"^(?:[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?)?$": "a name: at most 63 small letters, digits and inner hyphens",
    r"^[a-z0-9](?:[a-z0-9-]{0,61}[a-z0-9])?(?:@[A-Za-z0-9.-]{1,40})?$": "NAME, NAME@ALIAS or NAME@VERSION",
    r"^(?:[a-z0-9-]{1,63}@[A-Za-z0-9.-]{1,40})?$": "NAME@VERSION, or empty",
    r"^[a-z](?:[a-z0-9-]{0,38}[a-z0-9])?$": "an alias: 1 to 40 small letters, digits and inner hyphens, a letter first",
    r"^[A-Za-z0-9][A-Za-z0-9.-]{0,39}$": "a version or an alias: at most 40 letters, digits, points and hyphens",
    r"^(?:[A-Za-z0-9][A-Za-z0-9.-]{0,39})?$": "a version: at most 40 letters, digits, points and hyphens, or empty",
    r"^[1-9][0-9]{0,5}(?:KiB|MiB|GiB)$": "a memory size: a whole number and KiB, MiB or GiB, such as 64MiB",
    r"^[1-9][0-9]{1,4}x[1-9][0-9]{1,4}$": "a picture size: WIDTHxHEIGHT in pixels, 10 to 99999 each",
    r"^[A-Za-z0-9@.:+-]{0,140}$": "exact, TECHNIQUE:BUDGET or NAME@VERSION:BUDGET",
}
"""Pattern -> what matches it. Those of paths are not among them: what does not match one is not found."""

_TYPES: Final[Mapping[str, str]] = {
    "missing": "is missing",
    "extra_forbidden": "is nothing that is known here",
    "given_twice": "is given twice",
    "string_type": "has to be text",
    "int_type": "has to be a whole number",
    "int_parsing": "has to be a whole number",
    "int_parsing_size": "has to be a smaller whole number",
    "int_from_float": "has to be a whole number",
    "float_type": "has to be a number",
    "float_parsing": "has to be a number",
    "finite_number": "has to be a finite number",
    "bool_type": "has to be true or false",
    "bool_parsing": "has to be true or false",
    "list_type": "has to be a list",
    "tuple_type": "has to be a list",
    "dict_type": "has to be an object",
    "model_type": "has to be an object",
    "model_attributes_type": "has to be an object",
    "none_required": "has to be null",
    "timezone_aware": "has to be a time with a zone, as in 2026-01-31T12:00:00Z",
    "datetime_type": "has to be a time, as in 2026-01-31T12:00:00Z",
    "datetime_parsing": "has to be a time, as in 2026-01-31T12:00:00Z",
    "datetime_from_date_parsing": "has to be a time, as in 2026-01-31T12:00:00Z",
    "datetime_object_invalid": "has to be a time, as in 2026-01-31T12:00:00Z",
}
_BOUNDS: Final[Mapping[str, tuple[str, str]]] = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
    "multiple_of": ("multiple_of", "a multiple of"),
}
_LENGTHS: Final[Mapping[str, tuple[str, str, str]]] = {
    "string_too_short": ("min_length", "at least", "character"),
    "string_too_long": ("max_length", "at most", "character"),
    "too_short": ("min_length", "at least", "element"),
    "too_long": ("max_length", "at most", "element"),
}
_HAS: Final = "has to be "
_UNKNOWN: Final = "is not of the form that is expected"


def faults(errors: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Places in a request, each once, and what is wrong there.

    Args:
        errors: Of pydantic, whose `loc` begins with the part of the request.

    Returns:
        `at`, as in `body.scenes.0.scene`; `message`, what is allowed there.
    """
    found: dict[str, list[str]] = {}
    for error in errors:
        at = ".".join(_names(error))[:LENGTH]
        said = _message(error)
        if said not in found.setdefault(at, []):
            found[at].append(said)
    return [{"at": at, "message": _either(messages)[:LENGTH]} for at, messages in found.items()]


def sentence(fault: Mapping[str, str]) -> str:
    """One of `faults` as a sentence."""
    part, _, field = fault["at"].partition(".")
    message = fault["message"]
    begins = message.startswith(("has ", "is "))
    if not field:
        return f"The {part}{' ' if begins else ': '}{message}."
    return f"'{field}' {_PLACES.get(part, f'in the {part}')}{' ' if begins else ': '}{message}."


def _names(error: Mapping[str, Any]) -> list[str]:
    """The parts of a place; the names that pydantic gives the members of a union are none."""
    return [str(part) for part in error["loc"] if not (isinstance(part, str) and ("[" in part or "(" in part))]


def _message(error: Mapping[str, Any]) -> str:
    kind, context = str(error["type"]), error.get("ctx") or {}
    if kind in _TYPES:
        return _TYPES[kind]
    if kind in _BOUNDS:
        name, bound = _BOUNDS[kind]
        return f"{_HAS}{bound} {context[name]:g}"
    if kind in _LENGTHS:
        name, bound, unit = _LENGTHS[kind]
        count = context[name]
        return f"has to have {bound} {count} {unit}{'' if count == 1 else 's'}"
    if kind in ("literal_error", "enum"):
        return f"{_HAS}{context['expected']}" if context["expected"] != "''" else f"{_HAS}empty"
    if kind == "string_pattern_mismatch" and context["pattern"] in PATTERNS:
        return f"{_HAS}{PATTERNS[context['pattern']]}"
    if kind == "value_error":  # of a validator of ours
        return str(context["error"]).rstrip(".")
    return _UNKNOWN


def _either(messages: Sequence[str]) -> str:
    """What is allowed by any member of a union."""
    first, *others = messages
    return ", or ".join([first, *(other.removeprefix(_HAS) for other in others)])
