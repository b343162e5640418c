"""Packages (.usdz), good and bad, byte by byte."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Entry:
    """A member; what the central directory says may differ."""

    name: bytes
    data: bytes
    method: int = 0
    flags: int = 0
    crc: int | None = None
    size: int | None = None
    extra: bytes = b""
    listed: bool = True
    listed_name: bytes | None = None
    listed_offset: int | None = None

    @property
    def checksum(self) -> int:
        return zlib.crc32(self.data) if self.crc is None else self.crc


def archive(entries: list[Entry], before: bytes = b"", after: bytes = b"", comment: bytes = b"") -> bytes:
    """A zip archive with data aligned to 64 bytes."""
    out, directory, count = before, b"", 0
    for entry in entries:
        offset = len(out)
        padding = -(offset + 30 + len(entry.name) + len(entry.extra) + 4) % 64
        extra = entry.extra + struct.pack("<HH", 0x1986, padding) + b"\0" * padding
        size = len(entry.data) if entry.size is None else entry.size
        fields = (entry.flags, entry.method, 0, 0x21, entry.checksum, len(entry.data), size)
        out += struct.pack("<4sHHHHHIIIHH", b"PK\3\4", 20, *fields, len(entry.name), len(extra)) + entry.name + extra
        out += entry.data
        if entry.listed:
            name = entry.listed_name or entry.name
            where = offset if entry.listed_offset is None else entry.listed_offset
            lengths = (len(name), 0, 0, 0, 0, 0, where)
            directory += struct.pack("<4sHHHHHHIIIHHHHHII", b"PK\1\2", 20, 20, *fields, *lengths) + name
            count += 1
    end = struct.pack("<4sHHHHIIH", b"PK\5\6", 0, 0, count, count, len(directory), len(out), len(comment))
    return out + directory + end + comment + after


def plain(files: dict[str, bytes]) -> bytes:
    """A package as it should be."""
    return archive([Entry(name.encode(), data) for name, data in files.items()])


def attacks(layer: bytes, outside: bytes, image: bytes) -> dict[str, tuple[str, bytes]]:
    """Slug and bytes of bad packages by file name.

    Args:
        layer: A good layer.
        outside: One that refers to what lies outside.
        image: A good image.
    """
    good = Entry(b"a.usda", layer)
    deflater = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = deflater.compress(layer) + deflater.flush()
    zeros = zlib.compressobj(9, zlib.DEFLATED, -15)
    bomb = zeros.compress(b"\0" * 20_000_000) + zeros.flush()
    inner = plain({"b.usda": layer})
    cases: dict[str, bytes] = {
        "compressed": archive([Entry(b"a.usda", packed, 8, crc=zlib.crc32(layer), size=len(layer))]),
        "compressed-bomb": archive([good, Entry(b"b.png", bomb, 8, crc=0, size=20_000_000)]),
        "encrypted": archive([replace(good, flags=1)]),
        "streamed": archive([replace(good, flags=8)]),
        "checksum": archive([replace(good, crc=1)]),
        "zip64": archive([replace(good, extra=struct.pack("<HHQQ", 1, 16, len(layer), len(layer)))]),
        "size-beyond": archive([good])[:18] + b"\xf0\xff\xff\x7f\xf0\xff\xff\x7f" + archive([good])[26:],
        "package-inside": archive([good, Entry(b"b.usdz", inner)]),
        "archive-inside": archive([good, Entry(b"notes.txt", inner)]),
        "gzip-inside": archive([good, Entry(b"b.png", b"\x1f\x8b\x08\0" + packed)]),
        "unlisted": archive([good, Entry(b"b.usda", outside, listed=False)]),
        "listed-otherwise": archive([replace(good, listed_name=b"b.usda")]),
        "overlapping": archive([good, Entry(b"b.usda", layer, listed_offset=0)]),
        "twice": archive([good, Entry(b"a.usda", outside)]),
        "behind": archive([good], after=b"canary"),
        "comment": archive([good], comment=b"canary"),
        "before": archive([good], before=b"#!/bin/sh\n"),
        "image-first": archive([Entry(b"b.png", image), good]),
        "empty": archive([]),
        "cut": archive([good])[:90],
        "no-archive": b"canary" * 20,
        "bad-name": archive([good, Entry(b"\xff\xfe.png", image)]),
    }
    found = {f"archive-{name}.usdz": ("scene-archive", data) for name, data in cases.items()}
    for name, raw in (("parent", b"../canary/b.png"), ("absolute", b"/tmp/diaphane-canary/b.png"), ("drive", b"C:/b")):
        found[f"archive-name-{name}.usdz"] = ("scene-path-outside", archive([good, Entry(raw, image)]))
    for name, raw in (
        ("backslash", b"..\\b.png"),
        ("zero", b"b\0.png"),
        ("brackets", b"b[c].png"),
        ("dots", b"./b.png"),
    ):
        found[f"archive-name-{name}.usdz"] = ("scene-file-name", archive([good, Entry(raw, image)]))
    found["archive-refers-outside.usdz"] = ("scene-path-outside", plain({"a.usda": outside}))
    found["archive-unused-refers-outside.usdz"] = ("scene-path-outside", plain({"a.usda": layer, "b.usda": outside}))
    return found
