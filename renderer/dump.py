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

_CHUNK = 1 << 23
"""Elements of a chunk: large enough to compress well and few files, small enough to read by range."""

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
        counts, *arrays = (np.asarray(group[name]) for name in ("counts", *_ARRAYS))
        width, height = int(str(group.attrs["width"])), int(str(group.attrs["height"]))
    except (KeyError, FileNotFoundError, ValueError) as reason:
        raise _damaged(folder) from reason
    offsets = np.zeros(len(counts) + 1, dtype=np.int64)
    np.cumsum(counts, out=offsets[1:])
    dump = FragmentDump(width, height, offsets, *arrays)
    if len(counts) != dump.pixels or not len(dump.rgba) == dump.total == offsets[-1]:
        raise _damaged(folder)
    return dump


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
