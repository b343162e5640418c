"""Packages (.usdz), read in place the way USD reads them: one local header after the other from the first byte.

A package is accepted only if that reading and the central directory say the same, so that no other reader sees other
files. Members are stored, not compressed, so nothing can grow.
"""

from __future__ import annotations

import mmap
import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

from renderer.gate.files import LAYER_SUFFIXES, Kind, classify, suffix_of
from renderer.gate.images import HEAD
from renderer.gate.names import check_file_name
from renderer.gate.problems import RejectedScene, shown
from schemas.limits import LIMITS

LOCAL, CENTRAL, END = b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06"
LOCAL_HEADER = struct.Struct("<4sHHHHHIIIHH")
CENTRAL_HEADER = struct.Struct("<4sHHHHHHIIIHHHHHII")
END_RECORD = struct.Struct("<4sHHHHIIH")
UTF8_NAMES = 0x0800
ARCHIVES = (b"PK\x03\x04", b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"7z\xbc\xaf", b"Rar!", b"\x28\xb5\x2f\xfd")


@dataclass(frozen=True, slots=True)
class Member:
    """A file in a package.

    Attributes:
        name: Relative name in the package.
        offset: Where its bytes begin in the package.
        size: How many there are.
        kind: By suffix and first bytes.
        pixels: Of an image.
    """

    name: str
    offset: int
    size: int
    kind: Kind
    pixels: int


def read_package(path: Path, name: str) -> dict[str, Member]:
    """The members of a package by name, in their order; the first one is its root layer.

    Raises:
        RejectedScene: It is no plain package, or is read differently by different readers.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(handle, "rb"):
        if os.fstat(handle).st_size < LOCAL_HEADER.size + END_RECORD.size:
            raise _refused(name, "is too short")
        with mmap.mmap(handle, 0, access=mmap.ACCESS_READ) as data:
            try:
                return _Reader(data, name).members()
            except struct.error as error:
                raise _refused(name, "ends in the middle") from error


def _refused(name: str, reason: str) -> RejectedScene:
    return RejectedScene("scene-archive", f"The package {shown(name)} {reason}.")


class _Reader:
    def __init__(self, data: mmap.mmap, name: str) -> None:
        self._data = data
        self._name = name

    def members(self) -> dict[str, Member]:
        headers: list[tuple[bytes, int, int, int]] = []
        found: dict[str, Member] = {}
        at = 0
        while self._data[at : at + 4] == LOCAL:
            if len(headers) >= LIMITS.scene_files:
                raise RejectedScene("scene-too-large", f"The package {shown(self._name)} has too many files.")
            raw, offset, size, crc = self._local(at)
            headers.append((raw, at, size, crc))
            member = self._member(raw, offset, size, crc)
            if member.name in found:
                raise _refused(self._name, "has two files of one name")
            found[member.name] = member
            at = offset + size
        self._check_directory(at, headers)
        if not found or suffix_of(next(iter(found))) not in LAYER_SUFFIXES:
            raise _refused(self._name, "does not begin with a USD layer")
        return found

    def _local(self, at: int) -> tuple[bytes, int, int, int]:
        """Name, where the bytes begin, how many, checksum."""
        _, _, flags, method, _, _, crc, stored, size, name_size, extra_size = LOCAL_HEADER.unpack_from(self._data, at)
        if flags & ~UTF8_NAMES:
            raise _refused(self._name, "is encrypted, or was written as a stream")
        if method != 0 or stored != size:
            raise _refused(self._name, "has a compressed file")
        if size == 0xFFFFFFFF:
            raise _refused(self._name, "is a zip64 archive")
        name_at = at + LOCAL_HEADER.size
        offset = name_at + name_size + extra_size
        if offset + size > len(self._data):
            raise _refused(self._name, "has a file that goes beyond its end")
        self._check_extra(name_at + name_size, extra_size)
        return bytes(self._data[name_at : name_at + name_size]), offset, size, crc

    def _check_extra(self, at: int, size: int) -> None:
        end = at + size
        while at + 4 <= end:
            kind, length = struct.unpack_from("<HH", self._data, at)
            if kind == 1:
                raise _refused(self._name, "is a zip64 archive")
            at += 4 + length

    def _member(self, raw: bytes, offset: int, size: int, crc: int) -> Member:
        try:
            name = check_file_name(raw.decode("utf-8"), f"The package {shown(self._name)}")
        except UnicodeDecodeError as error:
            raise _refused(self._name, "has a name that is no UTF-8") from error
        if zlib.crc32(memoryview(self._data)[offset : offset + size]) != crc:
            raise _refused(self._name, "is damaged: a checksum is wrong")
        head = bytes(self._data[offset : offset + min(size, HEAD)])
        if suffix_of(name) in (".usdz", ".glb") or head.startswith(ARCHIVES):
            raise _refused(self._name, "has an archive in it")
        kind, pixels = classify(name, head, size)
        return Member(name, offset, size, kind, pixels)

    def _check_directory(self, at: int, headers: list[tuple[bytes, int, int, int]]) -> None:
        """The central directory lists exactly what was found, and nothing follows it."""
        first = at
        for raw, offset, size, crc in headers:
            fields = CENTRAL_HEADER.unpack_from(self._data, at)
            name_size, extra_size, comment_size = fields[10:13]
            name = bytes(self._data[at + CENTRAL_HEADER.size : at + CENTRAL_HEADER.size + name_size])
            said = (fields[0], fields[3] & ~UTF8_NAMES, fields[4], fields[7], fields[8], fields[9], name, fields[16])
            if said != (CENTRAL, 0, 0, crc, size, size, raw, offset):
                raise _refused(self._name, "has a directory that lists other files than it has")
            at += CENTRAL_HEADER.size + name_size + extra_size + comment_size
        count = len(headers)
        if END_RECORD.unpack_from(self._data, at) != (END, 0, 0, count, count, at - first, first, 0):
            raise _refused(self._name, "has a directory that lists other files than it has")
        if at + END_RECORD.size != len(self._data):
            raise _refused(self._name, "has something behind its end")
