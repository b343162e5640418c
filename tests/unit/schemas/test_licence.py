"""What words of licences are taken to say."""

from __future__ import annotations

import pytest

from schemas.licence import MOST_CHARACTERS, commercial_use, tidy, verdict


@pytest.mark.parametrize(
    ("licence", "use"),
    [
        ("CC0 (Adobe)", "allowed"),
        ("CC-BY-4.0, by somebody", "allowed"),
        ("CCBY 4.0, model by Eric Chadwick", "allowed"),
        ("Apache-2.0", "allowed"),
        ("MIT", "allowed"),
        ("Tomorrow Open Source Technology License 1.0", "allowed"),
        ("CC-BY-NC-4.0", "forbidden"),
        ("CC BY-NC-SA 4.0", "forbidden"),
        ("For non-commercial use", "forbidden"),
        ("editorial use", "forbidden"),
        ("", "unknown"),
        ("none stated", "unknown"),
        ("CC BY 4.0 from memory", "unknown"),
        ("CC-BY-SA-4.0", "unknown"),
        ("GPL-3.0", "unknown"),
        ("see the README", "unknown"),
        ("permitted by Acme", "unknown"),
    ],
)
def test_words_that_are_known(licence: str, use: str) -> None:
    assert commercial_use(licence) == use


def test_every_doubt_is_named_in_one_sentence() -> None:
    scenes = ("c", "a", "b")
    assert verdict(scenes, dict.fromkeys(scenes, "MIT")) == (
        "Commercial use is allowed by the licences of all 3 training scenes."
    )
    assert verdict(scenes, {"a": "CC-BY-NC-4.0", "c": "MIT"}) == (
        "Commercial use is NOT CLEARED: 1 of 3 training scenes forbid it by their licence (a); 1 of 3 training scenes "
        "have no licence that is known to allow it (b)."
    )


def test_what_a_stranger_writes_is_one_short_line() -> None:
    assert tidy(" CC0\n\x1b[31m by\t me ") == "CC0 [31m by me"
    assert len(tidy("x" * 10_000)) == MOST_CHARACTERS
