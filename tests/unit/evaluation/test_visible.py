from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from diaphane.cli.lines import plain
from evaluation.visible import is_visible, visible

TURNED = "bottle\u202egpj.exe"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (TURNED, "bottle\\u202egpj.exe"),
        ("\u2066a\u2069\u200e", "\\u2066a\\u2069\\u200e"),
        ("a\u200bb\ufeff\u00ad", "a\\u200bb\\ufeff\\xad"),
        ("\x1b[31mred\x9b", "\\x1b[31mred\\x9b"),
        ("one\u2028two", "one\\u2028two"),
        ("\U000e0041", "\\U000e0041"),
        ("\ud800", "\\ud800"),
        ("Gl\u00e4ser \u4e2d\u6587 \u0645\u06cc\u200c\u062e\u0648\u0627\u0647\u0645\n\t\u2013", None),
        ("\U0001f469\u200d\U0001f52c", None),
        ("plain", None),
    ],
)
def test_what_hides_something_is_written_out(text: str, shown: str | None) -> None:
    assert visible(text) == (text if shown is None else shown)


@given(st.text(alphabet=st.characters()))
def test_nothing_that_hides_is_left_and_the_rest_stays(text: str) -> None:
    shown = visible(text)
    assert all(map(is_visible, shown))
    assert all(unicodedata.bidirectional(sign) not in ("LRE", "RLE", "LRO", "RLO", "PDF") for sign in shown)
    if all(map(is_visible, text)):
        assert shown == text


def test_a_terminal_gets_one_line_of_what_can_be_seen() -> None:
    assert plain(f" {TURNED}\r\n\x1b]0;title\x07 ") == "bottle\\u202egpj.exe  \\x1b]0;title\\x07"
