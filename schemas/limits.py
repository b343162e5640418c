"""Every hard limit, in one place, with its unit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """What a single build accepts."""

    pixels: int = 7680 * 4320
    """Pixels of one view: one word a pixel must fit a storage buffer."""
    fragments: int = 250_000_000
    """Transparent fragments of one view: labelling takes up to 32 bytes for each."""
    buffer_bytes: int = 128 * 1024 * 1024
    """Bytes of one shader storage buffer: what llvmpipe advertises; larger captures go in bands of rows."""


LIMITS = Limits()
