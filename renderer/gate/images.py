"""Images by their headers: which are accepted, and how many pixels they have. Nothing is decoded."""

from __future__ import annotations

import struct
from collections.abc import Mapping

from renderer.gate.problems import RejectedScene, shown
from schemas.limits import LIMITS

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg")

PNG, JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
FOREIGN: tuple[tuple[bytes, int, str], ...] = (
    (b"\x76\x2f\x31\x01", 0, "OpenEXR"),
    (b"#?RADIANCE", 0, "Radiance"),
    (b"#?RGBE", 0, "Radiance"),
    (b"%!PS", 0, "PostScript"),
    (b"\xc5\xd0\xd3\xc6", 0, "PostScript"),
    (b"%PDF", 0, "PDF"),
    (b"GIF8", 0, "GIF"),
    (b"II*\x00", 0, "TIFF"),
    (b"MM\x00*", 0, "TIFF"),
    (b"II+\x00", 0, "TIFF"),
    (b"MM\x00+", 0, "TIFF"),
    (b"8BPS", 0, "Photoshop"),
    (b"DDS ", 0, "DDS"),
    (b"\xabKTX", 0, "KTX"),
    (b"WEBP", 8, "WebP"),
    (b"ftyp", 4, "HEIF"),
    (b"\x00\x00\x00\x0cjP  ", 0, "JPEG 2000"),
    (b"\xff\x4f\xff\x51", 0, "JPEG 2000"),
    (b"icns", 0, "icon"),
    (b"\x00\x00\x01\x00", 0, "icon"),
    (b"qoif", 0, "QOI"),
    (b"BM", 0, "BMP"),
)
"""First bytes, where they stand, and the name of image formats that no service decodes."""

FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""JPEG markers with the size of the picture."""
HEAD = 1 << 18
"""Bytes of a file's beginning that decide what it is: what counts of a JPEG may come after its embedded preview."""


DEPTHS: Mapping[int, tuple[int, ...]] = {0: (1, 2, 4, 8, 16), 2: (8, 16), 3: (1, 2, 4, 8), 4: (8, 16), 6: (8, 16)}
"""Colour types of PNG, and how many bits a sample of each may have (PNG, third edition, table 12)."""
PALETTE = 3


def is_image(head: bytes) -> bool:
    """Whether a file begins as a PNG or JPEG."""
    return head.startswith((PNG, JPEG))


def foreign_image(head: bytes) -> str | None:
    """The name of the format, if a file begins as an image or document that is not decoded here."""
    return next((name for magic, at, name in FOREIGN if head[at : at + len(magic)] == magic), None)


def check_image(name: str, head: bytes) -> int:
    """Pixels of a PNG or JPEG.

    Raises:
        RejectedScene: It is damaged, or has more pixels than are accepted.
    """
    size = _png_size(head) if head.startswith(PNG) else _jpeg_size(head)
    if size is None or not (size[0] and size[1]):
        raise RejectedScene("scene-texture", f"{shown(name)} is a damaged image.")
    fault = _png_fault(head) if head.startswith(PNG) else None
    if fault is not None:
        raise RejectedScene("scene-texture", f"{shown(name)} is a damaged image: {fault}.")
    pixels = size[0] * size[1]
    if pixels > LIMITS.texture_pixels:
        raise RejectedScene("scene-texture", f"{shown(name)} has {pixels} pixels, more than {LIMITS.texture_pixels}.")
    return pixels


def _png_size(head: bytes) -> tuple[int, int] | None:
    if len(head) < 24 or head[12:16] != b"IHDR":
        return None
    width, height = struct.unpack_from(">II", head, 16)
    return width, height


def _png_fault(head: bytes) -> str | None:
    """What a decoder would stumble over in front of the pixels, if there is anything."""
    depth, colour = head[24:26] if len(head) >= 26 else (0, -1)
    if depth not in DEPTHS.get(colour, ()):
        return "its kind of colour is none of PNG's"
    if colour != PALETTE:
        return None
    at = len(PNG)
    while at + 8 <= len(head):
        length, kind = struct.unpack_from(">I4s", head, at)
        if kind == b"PLTE":
            fits = length % 3 == 0 and 0 < length // 3 <= 1 << depth
            return None if fits else "its palette is of no possible size"
        if kind in (b"IDAT", b"IEND"):
            return "it has colours of a palette, and no palette"
        at += 12 + length
    return None if len(head) >= HEAD else "it has colours of a palette, and no palette"


def _jpeg_size(head: bytes) -> tuple[int, int] | None:
    at = 2
    while at + 9 <= len(head) and head[at] == 0xFF:
        marker = head[at + 1]
        if marker == 0xFF:
            at += 1
        elif marker in FRAMES:
            height, width = struct.unpack_from(">HH", head, at + 5)
            return width, height
        elif marker == 0x01 or 0xD0 <= marker <= 0xD9:
            at += 2
        else:
            at += 2 + struct.unpack_from(">H", head, at + 2)[0]
    return None
