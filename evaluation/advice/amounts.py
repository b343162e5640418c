"""Memory and size of a frame, as they are written in options and queries."""

from __future__ import annotations

import re
from typing import Final

from schemas.advice import Size
from schemas.flags import parse_size
from schemas.problem import Problem

DEFAULT_MEMORY: Final = "64MiB"
DEFAULT_SIZE: Final = "1920x1080"
_UNITS: Final = {"B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "KIB": 2**10, "MIB": 2**20, "GIB": 2**30}


def parse_frame(text: str) -> Size:
    """A size of a frame, as in `1920x1080`.

    Raises:
        Problem: It is none.
    """
    width, height = parse_size(text)
    if not width or not height:
        raise Problem(f"Invalid size '{text}': it has no pixels.", "Write it like --size 1920x1080.")
    return Size(width=width, height=height)


def parse_memory(text: str) -> int:
    """Bytes of `64MiB`, `1.5 GiB` or `500MB`.

    Raises:
        Problem: It is no memory.
    """
    found = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([KMG]?I?B)", text.strip().upper())
    count = int(float(found[1]) * _UNITS[found[2]]) if found and found[2] in _UNITS else 0
    if count < 1:
        raise Problem(f"Invalid memory '{text}'.", f"Write it like --memory {DEFAULT_MEMORY}, in KiB, MiB or GiB.")
    return count
