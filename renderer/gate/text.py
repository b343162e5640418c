"""Text layers before they are parsed: how large, and how deep brackets stand in each other.

The parser of USD takes a stack frame for each level and ends the process when the stack is full; it takes 15 s for
20,000 brackets.
"""

from __future__ import annotations

import re

from renderer.gate.problems import RejectedScene, shown

MAX_TEXT_BYTES = 512 << 20
"""Bytes of a text layer: parsed it takes several times as much."""
MAX_DEPTH = 256
"""Brackets in each other."""

_TOKENS = re.compile(
    rb'"""(?:[^\\"]|\\.|"(?!""))*+(?:"""|\Z|\\)'
    rb"|'''(?:[^\\']|\\.|'(?!''))*+(?:'''|\Z|\\)"
    rb'|"(?:[^"\\\n]|\\[^\n])*+(?:"|\\|(?=\n)|\Z)'
    rb"|'(?:[^'\\\n]|\\[^\n])*+(?:'|\\|(?=\n)|\Z)"
    rb"|@@@(?:[^@]|@(?!@@))*+(?:@@@|\Z)"
    rb"|@[^@\n]*+(?:@|(?=\n)|\Z)"
    rb"|/\*(?:[^*]|\*(?!/))*+(?:\*/|\Z)|//[^\n]*+|#[^\n]*+"
    # Vectors in a row, most of a large file, are one token.
    rb"|(?:\([^()\[\]{}\"'@#/]*+\)[\s,]*+)++"
    rb"|[\[\](){}]",
    re.DOTALL,
)
"""What hides brackets, and brackets. Every piece that begins is a token, ended or not: the time is linear."""


def check_text(data: bytes | memoryview, name: str) -> None:
    """Looks at a text layer's brackets.

    Raises:
        RejectedScene: It is too large or too deep.
    """
    if len(data) > MAX_TEXT_BYTES:
        raise RejectedScene("scene-too-large", f"The text layer {shown(name)} has more than {MAX_TEXT_BYTES} bytes.")
    depth = 0
    for token in _TOKENS.finditer(data):
        text = token[0]
        if text in (b"(", b"[", b"{"):
            depth += 1
        elif text in (b")", b"]", b"}"):
            depth -= 1
        if depth > MAX_DEPTH:
            raise RejectedScene("scene-too-large", f"{shown(name)} has more than {MAX_DEPTH} brackets in each other.")
