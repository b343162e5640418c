"""A zarr group in an artifact, of which only the files are fetched that are read: one pixel needs a few of hundreds."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterable

from zarr.abc.store import ByteRequest, OffsetByteRequest, RangeByteRequest, Store, SuffixByteRequest
from zarr.core.buffer import Buffer, BufferPrototype

from services.kept import Kept
from stages import store


class Members(Store):
    """A read-only store of zarr's, over files of an artifact that are verified one by one.

    What is not among the files was never written, and is zeros to zarr; an artifact that is gone is an error.

    Args:
        artifacts: Where artifacts lie.
        kept: Where files that were read are kept.
        artifact: `stage/key`.
        group: Folder of the group in it.
    """

    supports_writes = supports_deletes = supports_listing = False

    def __init__(self, artifacts: store.Store, kept: Kept, artifact: str, group: str) -> None:
        super().__init__(read_only=True)
        self._artifacts, self._kept = artifacts, kept
        self._artifact, self._group = artifact, group

    def __str__(self) -> str:
        return f"{self._artifact}/{self._group}"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Members) and str(other) == str(self) and other._artifacts is self._artifacts

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        """A file, or a part of it; None if there is none.

        Raises:
            MissingArtifact: The artifact is gone, or was damaged.
            Problem: The object store cannot be reached.
        """
        content = await asyncio.to_thread(self._read, key)
        return None if content is None else prototype.buffer.from_bytes(_part(content, byte_range))

    async def get_partial_values(
        self, prototype: BufferPrototype, key_ranges: Iterable[tuple[str, ByteRequest | None]]
    ) -> list[Buffer | None]:
        """Parts of files, as `get`."""
        return [await self.get(key, prototype, byte_range) for key, byte_range in key_ranges]

    async def exists(self, key: str) -> bool:
        """Whether there is such a file."""
        return await asyncio.to_thread(self._read, key) is not None

    async def set(self, key: str, value: Buffer) -> None:
        """An artifact never changes."""
        raise NotImplementedError

    async def delete(self, key: str) -> None:
        """An artifact never changes."""
        raise NotImplementedError

    def list(self) -> AsyncIterator[str]:
        """Nothing here asks what there is."""
        raise NotImplementedError

    def list_prefix(self, prefix: str) -> AsyncIterator[str]:
        """Nothing here asks what there is."""
        raise NotImplementedError

    def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """Nothing here asks what there is."""
        raise NotImplementedError

    def _read(self, key: str) -> bytes | None:
        name = f"{self._group}/{key}"
        try:
            return self._kept.get((self._artifact, name), lambda: self._artifacts.read(self._artifact, name), len)
        except FileNotFoundError:
            return None


def _part(content: bytes, wanted: ByteRequest | None) -> bytes:
    match wanted:
        case RangeByteRequest(start, end):
            return content[start:end]
        case OffsetByteRequest(offset):
            return content[offset:]
        case SuffixByteRequest(suffix):
            return content[-suffix:]
    return content
