"""The fragment dump on disk: a zarr v3 group, chunked and compressed, readable by any zarr library."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.codecs import BloscCodec

from renderer.tile_range import tile_grid, tile_ranges
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem

_CHUNK = 1 << 20
"""Elements of a chunk: enough to compress well in few files, few enough that one pixel is read in milliseconds."""

GROUP = "fragments.zarr"
"""Folder of the group."""
ARRAYS = ("rgba", "depth", "background", "facing", "tile_range")
"""Arrays of the group beside the counts: two of them by fragment, two by pixel, one by tile."""


def write_dump(folder: Path, dump: FragmentDump, about: Mapping[str, Any] | None = None) -> None:
    """Write a dump as `folder/fragments.zarr`; n(p) is stored, the offsets follow from it.

    Args:
        folder: An existing folder.
        dump: The fragments of a view.
        about: Further attributes of the group, JSON: what the view was.
    """
    group = zarr.open_group(folder / GROUP, mode="w")
    group.attrs.update({**(about or {}), "width": dump.width, "height": dump.height})
    _write(group, "counts", dump.counts.astype(np.uint32))
    for name in ARRAYS[:-1]:
        _write(group, name, getattr(dump, name))
    _write(group, ARRAYS[-1], tile_ranges(dump))


def read_dump(folder: Path) -> FragmentDump:
    """Read what `write_dump` wrote.

    Raises:
        Problem: There is none, or its arrays do not fit together.
    """
    try:
        group = zarr.open_group(folder / GROUP, mode="r")
        width, height = size_of(group)
        offsets, *arrays = _offsets(group), *(np.asarray(group[name]) for name in ARRAYS)
    except DAMAGE as reason:
        raise damaged(folder) from reason
    dump = FragmentDump(width, height, offsets, *arrays)
    columns, rows = tile_grid(width, height)
    fits = len(arrays[-1]) == columns * rows and len(offsets) - 1 == dump.pixels
    if not fits or not len(dump.rgba) == dump.total == offsets[-1]:
        raise damaged(folder)
    return dump


DAMAGE = (KeyError, FileNotFoundError, ValueError)
"""What reading a group raises that is not as it was written."""


def size_of(group: zarr.Group) -> tuple[int, int]:
    """Width and height of the view."""
    return int(str(group.attrs["width"])), int(str(group.attrs["height"]))


def _offsets(group: zarr.Group) -> NDArray[np.int64]:
    counts = np.asarray(group["counts"])
    offsets = np.zeros(len(counts) + 1, dtype=np.int64)
    np.cumsum(counts, out=offsets[1:])
    return offsets


def _write(group: zarr.Group, name: str, array: NDArray[np.generic]) -> None:
    chunks = (max(1, min(len(array), _CHUNK)), *array.shape[1:])
    # Shuffling by byte puts the high bytes of neighbouring depths together; lz4 then costs about as much as a copy.
    codec = BloscCodec(cname="lz4", clevel=3, shuffle="shuffle", typesize=array.dtype.itemsize)
    made = group.create_array(name, shape=array.shape, chunks=chunks, dtype=array.dtype, compressors=codec)
    if len(array):
        made[:] = array


def damaged(where: object) -> Problem:
    """What is said of a dump that is not as it was written."""
    return Problem(f"The fragment dump in {where} is damaged.", "Remove it: it is rendered again.", ExitCode.CONFLICT)
