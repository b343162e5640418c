"""Single pixels of a fragment dump: of its arrays only the chunks are read that hold the pixel's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import zarr
from zarr.abc.store import Store

from renderer.dump import ARRAYS, DAMAGE, GROUP, damaged, size_of
from renderer.tile_range import tile_grid
from schemas.fragments import FragmentDump
from schemas.tail import RANGE_TILE


class DumpReader:
    """A dump of which pixels are looked at.

    Args:
        source: Folder as of `renderer.dump.read_dump`, or a store whose root is the group.

    Attributes:
        width: Pixels per row.
        height: Rows.

    Raises:
        Problem: There is no dump, or its arrays do not fit together.
    """

    def __init__(self, source: Path | Store) -> None:
        self._source = source
        try:
            group = zarr.open_group(source / GROUP if isinstance(source, Path) else source, mode="r", zarr_format=3)
            self.width, self.height = size_of(group)
            self._counts, self._arrays = _array(group, "counts"), [_array(group, name) for name in ARRAYS]
            self._chunk = self._counts.chunks[0]
            starts = range(0, self._counts.shape[0], self._chunk)
            totals = [int(np.sum(self._part(start), dtype=np.int64)) for start in starts]
        except DAMAGE as reason:
            raise damaged(source) from reason
        self._before = np.concatenate([[0], np.cumsum(totals, dtype=np.int64)])
        lengths = [array.shape[0] for array in (self._counts, *self._arrays)]
        pixels, total = self.width * self.height, int(self._before[-1])
        columns, rows = tile_grid(self.width, self.height)
        if lengths != [pixels, total, total, pixels, pixels, columns * rows]:
            raise damaged(source)

    @property
    def bytes(self) -> int:
        """Memory that it holds."""
        return self._before.nbytes

    def pixel(self, p: int) -> FragmentDump:
        """The dump of one pixel, width and height 1.

        Args:
            p: Its index, y * width + x.

        Raises:
            Problem: The fragments are not there any more.
        """
        number, place = divmod(p, self._chunk)
        counts = self._part(number * self._chunk)
        first = int(self._before[number]) + int(np.sum(counts[:place], dtype=np.int64))
        end = first + int(counts[place])
        y, x = divmod(p, self.width)
        tile = y // RANGE_TILE * tile_grid(self.width, self.height)[0] + x // RANGE_TILE
        parts = (*[slice(first, end)] * 2, *[slice(p, p + 1)] * 2, slice(tile, tile + 1))
        rgba, *others = (np.asarray(array[part]) for array, part in zip(self._arrays, parts, strict=True))
        # zarr reads zeros where a chunk is missing; no fragment is stored with alpha 0.
        if not rgba[:, 3].all():
            raise damaged(self._source)
        return FragmentDump(1, 1, np.array([0, end - first], dtype=np.int64), rgba, *others)

    def _part(self, start: int) -> np.ndarray[Any, np.dtype[np.uint32]]:
        """uint32 [<= chunk], n(p) of a chunk."""
        return np.asarray(self._counts[start : start + self._chunk])


def _array(group: zarr.Group, name: str) -> zarr.Array[Any]:
    found = group[name]
    if not isinstance(found, zarr.Array):
        raise KeyError(name)
    return found
