"""Text of strangers as it is shown: what is not seen, or makes others be seen elsewhere, is written out.

U+202E turns what follows around, so that `gpj.exe` reads as a picture; others join, hide or end lines, or command a
terminal. They are kept in what is stored and sent, and escaped where somebody looks: in pages and on terminals.
"""

from __future__ import annotations

import re
import sys
import unicodedata
from functools import cache

_HIDDEN = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
"""Categories of Unicode: controls, formats, halves of surrogate pairs, separators of lines and paragraphs."""

_MEANT = frozenset("\t\n\r\u200c\u200d")
"""White space; and what joins letters or emoji, or keeps them apart, which scripts need."""


def visible(text: str) -> str:
    r"""The text with every sign that hides something as `\u202e`; white space stays."""
    if text.isascii() and text.isprintable():
        return text
    return _hidden().sub(lambda found: _escaped(found[0]), text)


def is_visible(sign: str) -> bool:
    """Whether a sign is shown as itself."""
    return sign in _MEANT or unicodedata.category(sign) not in _HIDDEN


def _escaped(sign: str) -> str:
    code = ord(sign)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


@cache
def _hidden() -> re.Pattern[str]:
    signs = "".join(re.escape(chr(code)) for code in range(sys.maxunicode + 1) if not is_visible(chr(code)))
    return re.compile(f"[{signs}]")
