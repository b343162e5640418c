"""Shards and indices: what is written is read, ranges are slices of the whole, and any changed byte is found."""

from __future__ import annotations

import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from support.shards import random_dataset, random_shard

from labeller.dataset import Dataset, open_dataset
from labeller.dataset_index import INDEX, read_index
from labeller.shard_file import Columns, open_columns, write_columns
from labeller.shards import Shard, read_rows, read_shard
from renderer.features import FEATURES
from schemas.problem import Problem
from schemas.tail import MOST_BINS

ROWS = 150


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    random_dataset(folder)
    return folder


@pytest.fixture(scope="module")
def view(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path = tmp_path_factory.mktemp("shard") / "view"
    random_shard(path)
    with open_columns(path) as file:
        return {**file.layout.view, "fragments": 1_000_000}  # as many as any table has


@st.composite
def tables(draw: st.DrawFn) -> tuple[Columns, list[tuple[list[int], list[float]]]]:
    """Columns of a shard, and the hull vertices that they stand for; rows without a hull among them."""
    hulls = []
    for _ in range(draw(st.integers(0, 12))):
        lengths = draw(st.lists(st.integers(1, 16_000), max_size=4))
        errors = sorted(draw(st.sets(st.floats(0.0, 3.0, width=32, exclude_min=True), min_size=4, max_size=4)))
        ks = [sum(lengths[:i]) for i in range(len(lengths) + 1)] if lengths else []
        hulls.append((ks, [*errors[::-1][4 - len(lengths) :], 0.0] if lengths else []))
    rows = len(hulls)
    finite = st.floats(allow_nan=False, allow_infinity=False, width=32)
    lengths = [b - a for ks, _ in hulls for a, b in pairwise(ks)]
    columns: Columns = {
        "features": draw(hnp.arrays(np.float32, (rows, len(FEATURES)), elements=finite)),
        "n": np.array([draw(st.integers(max([2 * MOST_BINS, *ks]), 65_535)) for ks, _ in hulls], dtype=np.uint16),
        "bin_counts": draw(hnp.arrays(np.uint8, (rows, MOST_BINS), elements=st.integers(0, 2))),
        "pixel": np.arange(rows, dtype=np.uint32) * 7,
        "hull_segments": np.array([max(len(ks) - 1, 0) for ks, _ in hulls], dtype=np.uint16),
        "hull_length": np.array(lengths, dtype=np.uint16),
        "hull_error": np.array([e for _, errors in hulls for e in errors[:-1]], dtype=np.float32),
    }
    return columns, hulls


@settings(max_examples=60, deadline=None)
@given(table=tables(), block_rows=st.integers(1, 13))
def test_what_is_written_is_read(
    view: dict[str, Any], table: tuple[Columns, list[tuple[list[int], list[float]]]], block_rows: int
) -> None:
    columns, hulls = table
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "shard"
        write_columns(path, columns, view, block_rows)
        shard = read_shard(path)
    np.testing.assert_array_equal(shard.features, columns["features"])
    np.testing.assert_array_equal(shard.n, columns["n"])
    np.testing.assert_array_equal(shard.bin_counts, columns["bin_counts"])
    np.testing.assert_array_equal(shard.pixel, columns["pixel"])
    assert len(shard.hull_offsets) == len(hulls) + 1
    for row, (ks, errors) in enumerate(hulls):
        part = slice(shard.hull_offsets[row], shard.hull_offsets[row + 1])
        assert shard.hull_k[part].tolist() == ks
        assert shard.hull_error[part].tolist() == errors
    assert shard.segments == len(columns["hull_length"])


def _slice(shard: Shard, start: int, stop: int) -> tuple[np.ndarray[Any, Any], ...]:
    first, last = shard.hull_offsets[start], shard.hull_offsets[stop]
    return (
        *(shard.features[start:stop], shard.n[start:stop], shard.bin_counts[start:stop], shard.pixel[start:stop]),
        shard.hull_offsets[start : stop + 1] - first,
        *(shard.hull_k[first:last], shard.hull_error[first:last]),
    )


@settings(max_examples=80, deadline=None)
@given(ends=st.tuples(st.integers(0, ROWS), st.integers(0, ROWS)), file=st.integers(0, 3))
def test_a_range_is_a_slice_of_the_whole(folder: Path, ends: tuple[int, int], file: int) -> None:
    dataset = open_dataset(folder)
    entry = dataset.index.shards[file]
    start, stop = sorted(ends)
    part, whole = dataset.rows(entry, start, stop), dataset.read(entry)
    assert part.meta == whole.meta
    for got, expected in zip(_slice(part, 0, stop - start), _slice(whole, start, stop), strict=True):
        np.testing.assert_array_equal(got, expected)
        assert got.dtype == expected.dtype


@settings(max_examples=300, deadline=None)
@given(where=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
def test_any_changed_byte_of_a_shard_is_found(folder: Path, where: float, flip: int) -> None:
    content = bytearray((folder / "box-front.safetensors").read_bytes())
    with tempfile.TemporaryDirectory() as name:
        damaged = Path(name) / "box-front.safetensors"
        content[int(where * len(content))] ^= flip
        damaged.write_bytes(content)
        with pytest.raises(Problem, match=r"box-front\.safetensors"):
            read_shard(damaged)


@settings(max_examples=150, deadline=None)
@given(data=st.data(), flip=st.integers(1, 255))
def test_any_changed_byte_of_a_header_is_found_by_a_range(folder: Path, data: st.DataObject, flip: int) -> None:
    content = bytearray((folder / "box-front.safetensors").read_bytes())
    size = 8 + int.from_bytes(content[:8], "little")
    content[data.draw(st.integers(0, size - 1))] ^= flip
    with tempfile.TemporaryDirectory() as name:
        damaged = Path(name) / "box-front.safetensors"
        damaged.write_bytes(content)
        with pytest.raises(Problem, match=r"box-front\.safetensors"):
            read_rows(damaged, 0, 1)
        with pytest.raises(Problem, match=r"box-front\.safetensors"):
            Dataset(Path(name), read_index(folder)).rows(read_index(folder).shards[0], 0, 1)


@settings(max_examples=150, deadline=None)
@given(where=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
def test_any_changed_byte_of_an_index_is_found(folder: Path, where: float, flip: int) -> None:
    content = bytearray((folder / INDEX).read_bytes())
    content[int(where * len(content))] ^= flip
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / INDEX
        path.write_bytes(content)
        with pytest.raises(Problem, match=r"index\.json"):
            read_index(path)


@settings(max_examples=60, deadline=None)
@given(size=st.floats(0.0, 1.0, exclude_max=True))
def test_a_shard_cut_off_anywhere_is_found(folder: Path, size: float) -> None:
    content = (folder / "box-front.safetensors").read_bytes()
    with tempfile.TemporaryDirectory() as name:
        cut = Path(name) / "box-front.safetensors"
        cut.write_bytes(content[: int(size * len(content))])
        with pytest.raises(Problem, match=r"box-front\.safetensors is damaged"):
            read_rows(cut, 0, 1)
