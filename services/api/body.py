"""Request bodies: read within a limit after the key was checked, and refused before anything is made of them.

Rules for JSON:
- the limit holds while reading, whatever `Content-Length` says or does not say;
- a body may not stop, and arrives at a least rate on average: who waits holds a place that others need;
- nothing is read on for a key that was revoked meanwhile;
- nesting is measured on the bytes, before a parser recurses into them;
- text that is no Unicode, NUL characters, NaN and infinities, and members named twice are refused: what follows would
  meet them as errors of a database or as different readings of the same text.
"""

from __future__ import annotations

import json
import math
import re
import time
from typing import Any, Generic, TypeVar

import anyio
from fastapi import Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ValidationError

from schemas.limits import LIMITS
from services.api.leases import revocable
from services.problems import Refusal

M = TypeVar("M", bound=BaseModel)

_CLOSE = {"Connection": "close"}
"""What has not been read would be taken for the next request."""

_TOKENS = re.compile(rb'"(?:[^"\\]|\\.)*"?|[\[\]{}]', re.DOTALL)
"""Strings and brackets. A string that does not end goes on to the end: looked for again behind each of its quotation
marks, it would take the square of its length."""


class JsonBody(Generic[M]):
    """A dependency that reads a body as a model; its schema is put into the OpenAPI document by `services.api.openapi`.

    Args:
        model: The model.
    """

    def __init__(self, model: type[M]) -> None:
        self.model = model

    async def __call__(self, request: Request) -> M:
        """The body.

        Raises:
            Refusal: It is too large, not JSON, or not well-formed.
            RequestValidationError: It is not of the model's form.
        """
        require_type(request, "application/json")
        value = parse_json(await read_body(request, LIMITS.body_bytes))
        try:
            # As JSON again: strictly, a list is a tuple in JSON and is none in Python.
            return self.model.model_validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            raise RequestValidationError([{**one, "loc": ("body", *one["loc"])} for one in error.errors()]) from None


def require_type(request: Request, media_type: str) -> None:
    """Refuses a body of another type.

    Raises:
        Refusal: The header `Content-Type` is missing or says something else.
    """
    found = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if found != media_type:
        raise Refusal("unsupported-media-type", f"The body has to be {media_type}.", headers={"Accept": media_type})


async def read_body(request: Request, limit: int) -> bytes:
    """A whole body of at most `limit` bytes.

    Raises:
        Refusal: It is larger, or arrives too slowly, or its key was revoked meanwhile.
    """
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced[:20]) > limit:
        raise _too_large(limit)
    with revocable(request.scope):
        return await _read(request, limit)
    raise Refusal("unauthenticated", "The key was revoked while the body arrived.", headers=_CLOSE)


async def _read(request: Request, limit: int) -> bytes:
    parts: list[bytes] = []
    size, begun = 0, time.monotonic()
    pieces = request.stream()
    while True:
        stall = LIMITS.body_stall_seconds
        late = stall + size / LIMITS.body_rate - (time.monotonic() - begun)
        try:
            with anyio.fail_after(min(stall, max(0.0, late))):
                part = await anext(pieces)
        except StopAsyncIteration:
            return b"".join(parts)
        except TimeoutError:
            detail = f"The body stopped for {stall:g} seconds, or came at less than {LIMITS.body_rate} bytes a second."
            raise Refusal("too-slow", detail, headers=_CLOSE) from None
        size += len(part)
        if size > limit:
            raise _too_large(limit)
        parts.append(part)


def parse_json(raw: bytes) -> Any:
    """The value of a JSON text; whole numbers are integers, however they are written.

    Raises:
        Refusal: It is not well-formed, or different readers would understand it differently.
    """
    try:
        text = raw.decode("utf-8")
    except UnicodeDecodeError:
        raise Refusal("malformed", "The body is not UTF-8.") from None
    if _depth(raw) > LIMITS.json_depth:
        raise Refusal("malformed", f"The body is nested more than {LIMITS.json_depth} deep.")
    try:
        value = json.loads(text, object_pairs_hook=_once, parse_float=_number, parse_constant=_no_constant)
    except Refusal:
        raise
    except (ValueError, RecursionError):
        raise Refusal("malformed", "The body is not JSON.") from None
    if _has_bad_text(value):
        raise Refusal("malformed", "A text in the body has a NUL character or half of a surrogate pair.")
    return value


def _too_large(limit: int) -> Refusal:
    return Refusal("too-large", f"The body is larger than {limit} bytes.")


def _depth(raw: bytes) -> int:
    depth = deepest = 0
    for token in _TOKENS.finditer(raw):
        first = raw[token.start()]
        if first in b"[{":
            depth += 1
            deepest = max(deepest, depth)
            if depth > LIMITS.json_depth:
                return depth
        elif first in b"]}":
            depth -= 1
    return deepest


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise Refusal("malformed", "An object in the body names a member twice.")
    return found


def _number(text: str) -> float | int:
    number = float(text)
    if not math.isfinite(number):
        _no_constant(text)
    return int(number) if number.is_integer() and abs(number) < 2.0**53 else number


def _no_constant(_name: str) -> Any:
    raise Refusal("malformed", "The body has NaN or an infinity.")


def _has_bad_text(value: Any) -> bool:
    if isinstance(value, str):
        return "\0" in value or any("\ud800" <= character <= "\udfff" for character in value if character > "\ud7ff")
    if isinstance(value, dict):
        return any(_has_bad_text(key) or _has_bad_text(item) for key, item in value.items())
    return isinstance(value, list) and any(_has_bad_text(item) for item in value)
