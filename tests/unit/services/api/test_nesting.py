"""Nesting of a body, measured on its bytes."""

from __future__ import annotations

import pytest

from schemas.limits import LIMITS
from services.api.body import parse_json
from services.problems import Refusal


@pytest.mark.parametrize("piece", [b'\\"', b"\\\\", b'a\\"['])
def test_a_string_that_does_not_end_is_refused_at_any_length(piece: bytes) -> None:
    # In the square of its length this would take half an hour.
    with pytest.raises(Refusal):
        parse_json(b'"' + piece * (LIMITS.body_bytes // len(piece)))


def test_brackets_within_strings_nest_nothing() -> None:
    text = "[" * 100 + '\\"' + "{" * 100
    assert parse_json(f'{{"a": "{text}"}}'.encode()) == {"a": "[" * 100 + '"' + "{" * 100}
