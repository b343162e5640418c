"""The head of an OpenEXR file, byte by byte ("OpenEXR File Layout"): attributes of name, type, size, value."""

from __future__ import annotations

import struct
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Attribute = str | int | float | NDArray[np.floating]
"""A value that a header can hold: text, a number, or float [3] or [4, 4]; matrices act on rows, as OpenEXR's do."""

MAGIC = 20000630
DEEP = 2 | 0x800
"""Version field: file version 2, a single part that is not a flat image."""
SHORT_NAME = 31
"""Longest name, bytes, without the flag for long ones."""

REC709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
"""Chromaticities of red, green, blue and white (ITU-R BT.709)."""

HALF, FLOAT = 1, 2
"""Types of a channel."""
ZIP_LINES = 16
"""Scan lines of a ZIP-compressed chunk."""


def attribute(name: str, value: Attribute) -> bytes:
    """One attribute of the head."""
    if isinstance(value, str):
        return packed(name, "string", value.encode())
    if isinstance(value, np.ndarray):
        kind = {(3,): "v3f", (4, 4): "m44f"}[value.shape]
        return packed(name, kind, np.ascontiguousarray(value, dtype="<f4").tobytes())
    if isinstance(value, int):
        return packed(name, "int", struct.pack("<i", value))
    return packed(name, "float", struct.pack("<f", value))


def packed(name: str, kind: str, value: bytes) -> bytes:
    """An attribute of any type, its value as bytes."""
    if not 0 < len(name.encode()) <= SHORT_NAME:
        raise ValueError(f"'{name}' is no name of an attribute")
    return b"%b\0%b\0%b%b" % (name.encode(), kind.encode(), struct.pack("<i", len(value)), value)


def channel_list(channels: Mapping[str, int]) -> bytes:
    """Value of the attribute `channels`: names and types, in the order of the samples, which is that of the names."""
    entries = [name.encode() + b"\0" + struct.pack("<iB3xii", channels[name], 0, 1, 1) for name in sorted(channels)]
    return b"".join(entries) + b"\0"


def window(width: int, height: int) -> bytes:
    """Value of `dataWindow` or `displayWindow`: first and last pixel."""
    return struct.pack("<4i", 0, 0, width - 1, height - 1)


def is_complete(data: bytes, chunks: int) -> bool:
    """Whether a flat file of one part has all its chunks, the last of them to its end.

    Args:
        data: The whole file.
        chunks: How many it should have.
    """
    try:
        at = 8  # magic number, version
        while data[at] != 0:
            after_type = data.index(b"\0", data.index(b"\0", at) + 1) + 1
            at = after_type + 4 + struct.unpack_from("<i", data, after_type)[0]
        offsets = struct.unpack_from(f"<{chunks}Q", data, at + 1)
        last = max(offsets)
        (size,) = struct.unpack_from("<i", data, last + 4)  # behind the number of its first line
        return bool(min(offsets) > 0 and last + 8 + size <= len(data))
    except (IndexError, ValueError, struct.error):
        return False
