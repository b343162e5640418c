"""Dumps on disk: what is read is what was written, whole and pixel by pixel, ranges of tiles among it."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import zarr
from support.dumps import random_dump

from labeller.curves import error_curves
from renderer.dump import GROUP, read_dump, write_dump
from renderer.dump_pixels import DumpReader
from renderer.tile_range import tile_grid, tile_ranges
from schemas.fragments import FragmentDump
from schemas.problem import Problem


def estimated(dump: FragmentDump) -> FragmentDump:
    """With ranges that are not those of the fragments."""
    return replace(dump, tile_range=tile_ranges(dump) * np.array([1.25, 0.75], np.float32))


@pytest.mark.parametrize("size", [(1, 1), (8, 8), (13, 21)])
@pytest.mark.parametrize("is_estimated", [False, True])
def test_what_is_written_is_read(tmp_path: Path, size: tuple[int, int], is_estimated: bool) -> None:
    dump = random_dump(*size, 9, seed=1)
    dump = estimated(dump) if is_estimated else dump
    write_dump(tmp_path, dump)
    found = read_dump(tmp_path)
    for field in fields(FragmentDump):
        expected = tile_ranges(dump) if field.name == "tile_range" else getattr(dump, field.name)
        assert np.array_equal(getattr(found, field.name), expected), field.name
    assert np.array_equal(error_curves(found).error, error_curves(dump).error)


def test_a_pixel_alone_has_its_tile_s_range_and_the_view_s_curve(tmp_path: Path) -> None:
    dump = estimated(random_dump(13, 21, 9, seed=2))
    write_dump(tmp_path, dump)
    reader, curves = DumpReader(tmp_path), error_curves(dump)
    for p in range(dump.pixels):
        own = error_curves(reader.pixel(p)).error
        assert np.array_equal(own, curves.error[curves.offsets[p] : curves.offsets[p + 1]])


@pytest.mark.parametrize("less", [0, 1])
def test_a_dump_without_a_range_for_every_tile_is_damaged(tmp_path: Path, less: int) -> None:
    dump = random_dump(13, 21, 9, seed=3)
    write_dump(tmp_path, dump)
    columns, rows = tile_grid(13, 21)
    group = zarr.open_group(tmp_path / GROUP, mode="a")
    del group["tile_range"]
    if less:
        ranges = group.create_array("tile_range", shape=(columns * rows - less, 2), dtype=np.float32)
        ranges[:] = 1.0
    for read in (read_dump, DumpReader):
        with pytest.raises(Problem, match="damaged"):
            read(tmp_path)
