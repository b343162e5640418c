"""The bytes of a label shard: a safetensors file of which every byte is verified, wholly or block by block.

Rules:
- rows are grouped in blocks of `BLOCK_ROWS`; the header holds the sha256 of each block over its part of every column,
  columns by name, and where each block's segments begin;
- the tensor `header_sha256` holds the sha256 of the header (its length, its JSON, its padding), so a shard is verified
  by itself; the index of a data set holds the same sum, so a shard cannot stand in for another;
- a range of rows reads the header and the blocks that it touches, nothing else;
- a file is written under a temporary name, synced, then renamed: readers see the old one or the new one.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import stat
import uuid
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator
from safetensors.numpy import save

from labeller.columns import COLUMNS, Column, CountType

BLOCK_ROWS: Final = 4096
"""Rows that share a checksum: about half a MiB, the least that is read to verify a row."""

SCHEMA_VERSION: Final = 2
"""Of the file's layout."""

_SUM: Final = "header_sha256"
_METADATA: Final = "shard"  # one key: the format keeps no order of several
_MAX_HEADER: Final = 1 << 26
_TYPES: Final = {"F32": "float32", "U16": "uint16", "U32": "uint32", "U8": "uint8"}

Columns = dict[str, NDArray[np.generic]]


class Layout(BaseModel):
    """What a header says beside the tensors' places.

    Attributes:
        rows: R.
        segments: S.
        block_rows: Rows of a block; the last one may have fewer.
        first_segments: [blocks + 1], first segment of each block; the last entry is S.
        blocks: Hex sha256 of each block.
        view: What concerns the whole view, JSON (`labeller.shards.ShardMeta`).
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    rows: int = Field(ge=0)
    segments: int = Field(ge=0)
    block_rows: int = Field(gt=0)
    first_segments: tuple[int, ...]
    blocks: tuple[str, ...]
    view: dict[str, Any]

    @model_validator(mode="after")
    def _fits(self) -> Layout:
        first, blocks = self.first_segments, -(-self.rows // self.block_rows)
        ends = (len(self.blocks), len(first), *first[:1], *first[-1:]) == (blocks, blocks + 1, 0, self.segments)
        if not ends or any(start > end for start, end in pairwise(first)):
            raise ValueError("the blocks do not fit the rows")
        return self


@dataclass(frozen=True, slots=True)
class Written:
    """A shard's bytes as they were written.

    Attributes:
        sha256: Hex, of the whole file.
        header_sha256: Hex, of the header, which holds those of all blocks.
        bytes: Size of the file.
    """

    sha256: str
    header_sha256: str
    bytes: int


class Damage(ValueError):
    """A file is not what was written; the text says in which way."""


class OtherSchema(Damage):
    """A file has the layout of another version of Diaphane."""


def write_columns(path: Path, columns: Columns, view: dict[str, Any], block_rows: int = BLOCK_ROWS) -> Written:
    """Writes a shard, atomically.

    Args:
        path: File to write; its folder exists.
        columns: Tensors named and shaped as in `labeller.columns`.
        view: What concerns the whole view, JSON.
        block_rows: Rows that share a checksum.
    """
    rows, segments = len(columns["hull_segments"]), len(columns["hull_length"])
    starts = np.arange(0, rows, block_rows)
    ends = np.concatenate([np.zeros(1, np.int64), np.cumsum(columns["hull_segments"], dtype=np.int64)])
    first_segments = [*map(int, ends[starts]), segments]
    layout = Layout(
        rows=rows,
        segments=segments,
        block_rows=block_rows,
        first_segments=tuple(first_segments),
        blocks=tuple(_digest(block) for block in _blocks(columns, rows, block_rows, first_segments)),
        view=view,
    )
    about = json.dumps({"schema_version": SCHEMA_VERSION, **layout.model_dump(mode="json")}, separators=(",", ":"))
    tensors = {name: np.ascontiguousarray(column) for name, column in columns.items()}
    content = bytearray(save({**tensors, _SUM: np.zeros(32, np.uint8)}, metadata={_METADATA: about}))
    size = 8 + int.from_bytes(content[:8], "little")
    header = hashlib.sha256(content[:size])
    begin, end = json.loads(content[8:size])[_SUM]["data_offsets"]
    content[size + begin : size + end] = header.digest()
    write_atomically(path, content)
    return Written(hashlib.sha256(content).hexdigest(), header.hexdigest(), len(content))


def write_atomically(path: Path, content: bytes | bytearray) -> None:
    """Replaces a file in one step; a crash leaves the old one or the new one.

    Args:
        path: File to write; its folder exists.
        content: Of the file.
    """
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}.partial")
    try:
        with partial.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    finally:
        partial.unlink(missing_ok=True)


class ShardFile:
    """A shard open for reading. One descriptor serves any number of threads; a file replaced meanwhile stays as it was.

    Attributes:
        layout: What the header says, verified.
        header_sha256: Hex, of the header.
    """

    def __init__(self, descriptor: int, expected: str | None) -> None:
        self._descriptor = descriptor
        prefix = self._read(0, 8)
        size = int.from_bytes(prefix.tobytes(), "little")
        if size > _MAX_HEADER:
            raise Damage("it does not begin with the length of a header")
        header = self._read(8, size).tobytes()
        self._data = 8 + size
        described = json.loads(header)
        about = json.loads(described.pop("__metadata__")[_METADATA])
        if about.pop("schema_version", None) != SCHEMA_VERSION:
            raise OtherSchema("another version of Diaphane wrote it")
        self._tensors = {name: _Tensor.of(entry) for name, entry in described.items()}
        self.header_sha256 = hashlib.sha256(prefix.tobytes() + header).hexdigest()
        if self._part(_SUM, 0, 32).tobytes().hex() != self.header_sha256:
            raise Damage("its header does not match its checksum")
        if expected is not None and expected != self.header_sha256:
            raise Damage("it is not the file that the index names")
        if os.fstat(descriptor).st_size != self._data + max(tensor.end for tensor in self._tensors.values()):
            raise Damage("its length is not the one it was written with")
        self.layout = Layout.model_validate(about)
        for name, column in COLUMNS.items():
            if not self._tensors[name].fits(column, self.layout):
                raise Damage(f"its tensor {name} does not have the rows that its header says")

    @property
    def count_type(self) -> CountType:
        """The dtype of the columns that count fragments."""
        return "uint16" if self._tensors["n"].dtype == "uint16" else "uint32"

    def read(self, start: int, stop: int) -> Columns:
        """The columns of the rows `start <= r < stop`, verified, and the segments of these rows.

        Raises:
            Damage: A block that the range touches is not what was written.
        """
        layout = self.layout
        first, last = start // layout.block_rows, -(-stop // layout.block_rows) if stop > start else 0
        last = max(first, last)
        rows = min(first * layout.block_rows, layout.rows), min(last * layout.block_rows, layout.rows)
        segments = layout.first_segments[first], layout.first_segments[last]
        read = {
            name: self._part(name, *(rows if column.per == "row" else segments)) for name, column in COLUMNS.items()
        }
        relative = [layout.first_segments[block] - segments[0] for block in range(first, last + 1)]
        for number, block in enumerate(_blocks(read, rows[1] - rows[0], layout.block_rows, relative)):
            if _digest(block) != layout.blocks[first + number]:
                begin = rows[0] + number * layout.block_rows
                raise Damage(f"the rows from {begin} on do not match their checksum")
            if len(block["hull_length"]) != block["hull_segments"].sum(dtype=np.int64):
                raise Damage("its rows do not have the segments that they say")
        return _cut(read, start - rows[0], stop - rows[0])

    def _part(self, name: str, start: int, stop: int) -> NDArray[np.generic]:
        """Entries of a tensor's first axis, read from the disk."""
        tensor = self._tensors[name]
        out = np.empty((stop - start, *tensor.shape[1:]), dtype=tensor.dtype)
        self._fill(out, self._data + tensor.begin + start * out.dtype.itemsize * math.prod(tensor.shape[1:]))
        return out

    def _read(self, offset: int, count: int) -> NDArray[np.uint8]:
        out = np.empty(count, dtype=np.uint8)
        self._fill(out, offset)
        return out

    def _fill(self, out: NDArray[np.generic], offset: int) -> None:
        view = out.reshape(-1).view(np.uint8).data
        while view:
            count = os.preadv(self._descriptor, [view], offset)
            if count == 0:
                raise Damage("it ends too early")
            view, offset = view[count:], offset + count


@contextmanager
def open_columns(path: Path, expected: str | None = None) -> Iterator[ShardFile]:
    """A shard, its header verified.

    Args:
        path: The file.
        expected: Hex sha256 that its header shall have, from an index.

    Raises:
        Damage: The file is not what was written.
        OSError: It cannot be read.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # a pipe that nobody writes to would never open
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise Damage("it is not a file")
        try:
            file = ShardFile(descriptor, expected)
        except (KeyError, TypeError, AttributeError, OverflowError, MemoryError, RecursionError) as error:
            raise Damage(f"its header is not valid ({type(error).__name__})") from error
        except Damage:
            raise
        except ValueError as error:  # JSON, UTF-8, pydantic
            raise Damage("its header is not valid") from error
        yield file
    finally:
        os.close(descriptor)


@dataclass(frozen=True, slots=True)
class _Tensor:
    dtype: str
    shape: tuple[int, ...]
    begin: int
    end: int

    @staticmethod
    def of(entry: Mapping[str, Any]) -> _Tensor:
        begin, end = entry["data_offsets"]
        return _Tensor(_TYPES[entry["dtype"]], tuple(map(int, entry["shape"])), int(begin), int(end))

    def fits(self, column: Column, layout: Layout) -> bool:
        """Whether it is that column of so many rows; its place then bounds its size by that of the file."""
        types = (column.dtype, "uint32") if column.dtype == "uint16" else (column.dtype,)
        entries = layout.rows if column.per == "row" else layout.segments
        shape = (entries, len(column.fields)) if column.fields else (entries,)
        size = np.dtype(self.dtype).itemsize * math.prod(shape)
        return self.dtype in types and self.shape == shape and 0 <= self.begin == self.end - size


def _blocks(columns: Columns, rows: int, block_rows: int, first_segments: list[int]) -> Iterator[Columns]:
    """Each block's part of every column."""
    for number, start in enumerate(range(0, rows, block_rows)):
        parts = {
            "row": slice(start, min(start + block_rows, rows)),
            "segment": slice(first_segments[number], first_segments[number + 1]),
        }
        yield {name: columns[name][parts[column.per]] for name, column in COLUMNS.items()}


def _digest(columns: Mapping[str, NDArray[np.generic]]) -> str:
    """Hex sha256 of columns; their names, types and lengths are in the header."""
    hasher = hashlib.sha256()
    for _, column in sorted(columns.items()):
        hasher.update(np.ascontiguousarray(column).reshape(-1).view(np.uint8).data)
    return hasher.hexdigest()


def _cut(columns: Columns, start: int, stop: int) -> Columns:
    """Rows `start <= r < stop` of columns, and their segments."""
    counts = columns["hull_segments"]
    first = int(counts[:start].sum(dtype=np.int64))
    parts = {"row": slice(start, stop), "segment": slice(first, first + int(counts[start:stop].sum(dtype=np.int64)))}
    return {name: column[parts[COLUMNS[name].per]] for name, column in columns.items()}
