"""The fragment dump on disk: a zarr v3 group, chunked and compressed, readable by any zarr library."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import BloscCodec

from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem

_CHUNK = 1 << 20
"""Elements of a chunk: enough to compress well in few files, few enough that one pixel is read in milliseconds."""

_ARRAYS = ("rgba", "depth", "background", "facing")


def write_dump(folder: Path, dump: FragmentDump, about: Mapping[str, Any] | None = None) -> None:
    """Write a dump as `folder/fragments.zarr`; n(p) is stored, the offsets follow from it.

    Args:
        folder: An existing folder.
        dump: The fragments of a view.
        about: Further attributes of the group, JSON: what the view was.
    """
    group = zarr.open_group(folder / "fragments.zarr", mode="w")
    group.attrs.update({**(about or {}), "width": dump.width, "height": dump.height})
    _write(group, "counts", dump.counts.astype(np.uint32))
    for name in _ARRAYS:
        _write(group, name, getattr(dump, name))


def read_dump(folder: Path) -> FragmentDump:
    """Read what `write_dump` wrote.

    Raises:
        Problem: There is none, or its arrays do not fit together.
    """
    try:
        group = zarr.open_group(folder / "fragments.zarr", mode="r")
        width, height = _size(group)
        offsets, *arrays = _offsets(group), *(np.asarray(group[name]) for name in _ARRAYS)
    except _DAMAGE as reason:
        raise _damaged(folder) from reason
    dump = FragmentDump(width, height, offsets, *arrays)
    if len(offsets) - 1 != dump.pixels or not len(dump.rgba) == dump.total == offsets[-1]:
        raise _damaged(folder)
    return dump


class DumpReader:
    """Single pixels of a dump on disk: of its fragments only the chunks are read that hold the pixel's.

    Args:
        folder: As of `read_dump`.

    Attributes:
        width: Pixels per row.
        height: Rows.

    Raises:
        Problem: There is no dump, or its arrays do not fit together.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            group = zarr.open_group(folder / "fragments.zarr", mode="r")
            self.width, self.height = _size(group)
            self._offsets, self._arrays = _offsets(group), [_array(group, name) for name in _ARRAYS]
        except _DAMAGE as reason:
            raise _damaged(folder) from reason
        lengths, pixels = [array.shape[0] for array in self._arrays], self.width * self.height
        if len(self._offsets) - 1 != pixels or lengths != [self._offsets[-1], self._offsets[-1], pixels, pixels]:
            raise _damaged(folder)

    @property
    def bytes(self) -> int:
        """Memory that it holds."""
        return self._offsets.nbytes

    def pixel(self, p: int) -> FragmentDump:
        """The dump of one pixel, width and height 1.

        Args:
            p: Its index, y * width + x.

        Raises:
            Problem: The fragments are not there any more.
        """
        first, end = (int(offset) for offset in self._offsets[p : p + 2])
        parts = (slice(first, end), slice(first, end), slice(p, p + 1), slice(p, p + 1))
        rgba, *others = (np.asarray(array[part]) for array, part in zip(self._arrays, parts, strict=True))
        # zarr reads zeros where a chunk is missing; no fragment is stored with alpha 0.
        if not rgba[:, 3].all():
            raise _damaged(self._folder)
        return FragmentDump(1, 1, np.array([0, end - first], dtype=np.int64), rgba, *others)


_DAMAGE = (KeyError, FileNotFoundError, ValueError)
"""What reading a group raises that is not as it was written."""


def _size(group: zarr.Group) -> tuple[int, int]:
    return int(str(group.attrs["width"])), int(str(group.attrs["height"]))


def _offsets(group: zarr.Group) -> NDArray[np.int64]:
    counts = np.asarray(group["counts"])
    offsets = np.zeros(len(counts) + 1, dtype=np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets


def _array(group: zarr.Group, name: str) -> zarr.Array[Any]:
    found = group[name]
    if not isinstance(found, zarr.Array):
        raise KeyError(name)
    return found


def _write(group: zarr.Group, name: str, array: NDArray[np.generic]) -> None:
    chunks = (max(1, min(len(array), _CHUNK)), *array.shape[1:])
    # Shuffling by byte puts the high bytes of neighbouring depths together; lz4 then costs about as much as a copy.
    codec = BloscCodec(cname="lz4", clevel=3, shuffle="shuffle", typesize=array.dtype.itemsize)
    made = group.create_array(name, shape=array.shape, chunks=chunks, dtype=array.dtype, compressors=codec)
    if len(array):
        made[:] = array


def _damaged(folder: Path) -> Problem:
    return Problem(
        f"The fragment dump in {folder} is damaged.", "Delete that folder: it is rendered again.", ExitCode.CONFLICT
    )
