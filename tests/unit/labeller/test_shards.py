"""Label shards: what a row holds, what of a file is read, and that damage is found."""

from __future__ import annotations

import hashlib
import json
import math
import os
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load_file
from support.dumps import random_dump
from support.shards import random_shard

from labeller.columns import COLUMNS
from labeller.curves import error_curves, whole_bins
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from labeller.shard_file import open_columns, write_columns
from labeller.shards import Shard, read_rows, read_shard, write_shard
from renderer.depth_bins import bin_counts
from renderer.features import FEATURES, derive, gather
from schemas.problem import ExitCode, Problem
from schemas.tail import DEFAULT_TAIL, MOST_BINS

DUMP = random_dump(40, 30, 8, seed=1)
CURVES = whole_bins(DUMP, error_curves(DUMP))
HULLS = lower_hulls(CURVES)
BUDGETS = [DUMP.pixels, 2 * DUMP.pixels, 40 * DUMP.pixels]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("shards") / "view.safetensors"
    write_shard(path, DUMP, CURVES, HULLS, BUDGETS)
    return path


@pytest.fixture(scope="module")
def shard(path: Path) -> Shard:
    return read_shard(path)


def test_rows_hold_the_hulls_and_features_of_their_pixels(shard: Shard) -> None:
    features = derive(gather(DUMP, DEFAULT_TAIL))
    assert shard.features.shape == (len(shard.n), len(FEATURES))
    assert np.array_equal(shard.features, features[shard.pixel])
    assert np.array_equal(shard.n, DUMP.counts[shard.pixel])
    assert np.array_equal(shard.bin_counts, bin_counts(DUMP, DEFAULT_TAIL)[shard.pixel])
    assert np.array_equal(shard.bin_counts.sum(axis=1), shard.n), "no bin is full"
    for row, p in enumerate(shard.pixel):
        mine = slice(shard.hull_offsets[row], shard.hull_offsets[row + 1])
        theirs = slice(HULLS.offsets[p], HULLS.offsets[p + 1])
        assert np.array_equal(shard.hull_k[mine], HULLS.k[theirs])
        assert np.array_equal(shard.hull_error[mine], HULLS.error[theirs])


def test_a_fifth_of_the_pixels_with_fragments_is_sampled(shard: Shard) -> None:
    occupied = int(np.count_nonzero(DUMP.counts))
    assert shard.meta.occupied == occupied
    assert len(shard.n) == pytest.approx(0.2 * occupied, abs=1)
    assert (DUMP.counts[shard.pixel] > 0).all()
    assert (np.diff(shard.hull_offsets)[shard.n == 1] == 0).all(), "exact at k = 0: no segment"
    assert (shard.n == 1).any()
    assert shard.sampled_pixels == pytest.approx(0.2 * DUMP.pixels, rel=0.02)


def test_levels_are_those_of_the_optimum(shard: Shard) -> None:
    assert [x.budget for x in shard.meta.levels] == sorted({x.budget for x in shard.meta.levels})
    assert [x.budget for x in shard.meta.levels if x.scored] == [b for b in BUDGETS if b < DUMP.total]
    for level in shard.meta.levels:
        (found,) = allocate_curves(DUMP, CURVES, [level.budget], "optimal")
        assert (level.error, level.bound) == (found.error, found.bound)
        assert level.log_lambda == (math.log(found.lam) if found.lam else None)
    low, high = shard.price_range
    assert low < high
    assert all(low <= anchor <= high for anchor in shard.anchors)


def test_the_same_view_gives_the_same_bytes_and_another_seed_other_rows(path: Path, tmp_path: Path) -> None:
    write_shard(tmp_path / "again", DUMP, CURVES, HULLS, BUDGETS)
    assert (tmp_path / "again").read_bytes() == path.read_bytes()
    write_shard(tmp_path / "other", DUMP, CURVES, HULLS, BUDGETS, seed=1)
    assert not np.array_equal(read_shard(tmp_path / "other").pixel, read_shard(path).pixel)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["again", "other"]


def test_weights_are_named_where_there_are_any(path: Path, tmp_path: Path) -> None:
    write_shard(tmp_path / "weighted", DUMP, CURVES, HULLS, BUDGETS, weights="flip")
    assert (read_shard(path).meta.weights, read_shard(tmp_path / "weighted").meta.weights) == ("none", "flip")
    # What was written before there were any is what is written without them.
    headers = []
    for written in (path, tmp_path / "weighted"):
        with open_columns(written) as file:
            headers.append(dict(file.layout.view))
    assert "weights" not in headers[0]
    assert headers[1] == {**headers[0], "weights": "flip"}


def test_a_view_in_which_nothing_can_be_gained_has_rows_without_segments(tmp_path: Path) -> None:
    dump = random_dump(4, 4, 1, seed=0)
    curves = error_curves(dump)
    write_shard(tmp_path / "flat", dump, curves, lower_hulls(curves), [dump.pixels])
    shard = read_shard(tmp_path / "flat")
    assert len(shard.n) > 0
    assert shard.segments == 0
    assert shard.price_range == (0.0, 0.0)


@pytest.mark.parametrize("where", [0.0, 0.002, 0.02, 0.3, 0.7, 0.999])
def test_a_changed_byte_is_found_and_the_file_is_named(path: Path, tmp_path: Path, where: float) -> None:
    content = bytearray(path.read_bytes())
    content[int(where * len(content))] ^= 0x11
    damaged = tmp_path / "damaged.safetensors"
    damaged.write_bytes(content)
    with pytest.raises(Problem, match=r"damaged\.safetensors is damaged") as caught:
        read_shard(damaged)
    assert caught.value.code is ExitCode.CHECK_FAILED
    assert "run the same command again" in caught.value.remedy


@pytest.mark.parametrize("size", [0, 7, 5000])
def test_a_cut_off_file_is_found(path: Path, tmp_path: Path, size: int) -> None:
    (tmp_path / "cut").write_bytes(path.read_bytes()[:size])
    with pytest.raises(Problem, match="cut is damaged"):
        read_shard(tmp_path / "cut")


def test_a_longer_file_is_found(path: Path, tmp_path: Path) -> None:
    (tmp_path / "long").write_bytes(path.read_bytes() + b"\0")
    with pytest.raises(Problem, match="long is damaged: its length"):
        read_shard(tmp_path / "long")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(Problem, match=r"no label shard .*nowhere"):
        read_shard(tmp_path / "nowhere")


def test_a_file_of_another_version_says_so(path: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_bytes(path.read_bytes().replace(b'\\"schema_version\\":2', b'\\"schema_version\\":1'))
    with pytest.raises(Problem, match="another version of Diaphane"):
        read_shard(other)


def test_the_file_is_plain_safetensors(path: Path, shard: Shard) -> None:
    tensors = load_file(path)
    assert set(tensors) == {*COLUMNS, "header_sha256"}
    for name, column in COLUMNS.items():
        assert tensors[name].dtype == column.dtype
    np.testing.assert_array_equal(tensors["features"], shard.features)
    starts = np.concatenate([[0], np.cumsum(tensors["hull_segments"], dtype=np.int64)])
    row = int(np.argmax(tensors["n"]))
    mine = slice(starts[row], starts[row + 1])
    hull = slice(shard.hull_offsets[row], shard.hull_offsets[row + 1])
    k = np.concatenate([[0], np.cumsum(tensors["hull_length"][mine], dtype=np.int64)])
    np.testing.assert_array_equal(k, shard.hull_k[hull])
    np.testing.assert_array_equal(np.append(tensors["hull_error"][mine], 0.0), shard.hull_error[hull])


def test_a_feature_has_a_meaning() -> None:
    assert tuple(COLUMNS["features"].fields) == FEATURES


def test_a_range_reads_and_verifies_its_own_blocks_alone(tmp_path: Path) -> None:
    path = tmp_path / "view"
    random_shard(path, block_rows=16)
    whole = read_shard(path)
    content = bytearray(path.read_bytes())
    size = 8 + int.from_bytes(content[:8], "little")
    begin = size + json.loads(content[8:size])["features"]["data_offsets"][0]
    content[begin + 40 * len(FEATURES) * 4] ^= 1  # row 40 is in the third block
    path.write_bytes(content)
    for start, stop in ((0, 32), (16, 17), (48, len(whole.n)), (32, 32)):
        np.testing.assert_array_equal(read_rows(path, start, stop).features, whole.features[start:stop])
    for start, stop in ((0, 33), (32, 33), (47, 60)):
        with pytest.raises(Problem, match="the rows from 32 on do not match"):
            read_rows(path, start, stop)


@pytest.mark.parametrize(("start", "stop"), [(-1, 3), (5, 4), (0, 10**6)])
def test_rows_that_a_shard_does_not_have_are_refused(path: Path, start: int, stop: int) -> None:
    with pytest.raises(IndexError, match="view"):
        read_rows(path, start, stop)


def test_a_shard_is_not_taken_for_another(path: Path, tmp_path: Path) -> None:
    written = random_shard(tmp_path / "other")
    read_shard(tmp_path / "other", written.header_sha256)
    for read in (lambda: read_shard(path, written.header_sha256), lambda: read_rows(path, 0, 1, written.header_sha256)):
        with pytest.raises(Problem, match="not the file that the index names"):
            read()


def test_lists_longer_than_65535_need_wider_columns(tmp_path: Path) -> None:
    columns = {
        "features": np.zeros((2, len(FEATURES)), np.float32),
        "n": np.array([70_000, 2], np.uint32),
        "bin_counts": np.full((2, MOST_BINS), [[255], [0]], np.uint8),
        "pixel": np.array([0, 1], np.uint32),
        "hull_segments": np.array([2, 0], np.uint32),
        "hull_length": np.array([69_000, 900], np.uint32),
        "hull_error": np.array([0.5, 0.25], np.float32),
    }
    random_shard(tmp_path / "view")
    with open_columns(tmp_path / "view") as file:
        view = file.layout.view
    write_columns(tmp_path / "wide", columns, {**view, "fragments": 70_002})
    shard = read_shard(tmp_path / "wide")
    np.testing.assert_array_equal(shard.n, [70_000, 2])
    assert shard.bin_counts.tolist() == [[255] * MOST_BINS, [0] * MOST_BINS]
    np.testing.assert_array_equal(shard.hull_k, [0, 69_000, 69_900])
    np.testing.assert_array_equal(shard.hull_error, np.array([0.5, 0.25, 0.0], np.float32))
    np.testing.assert_array_equal(shard.hull_offsets, [0, 3, 3])


@pytest.mark.parametrize(
    ("column", "where", "value", "words"),
    [
        ("features", (3, 3), np.nan, "features that are not finite"),
        ("features", (3, 3), np.inf, "features that are not finite"),
        ("hull_error", 0, np.nan, "errors that do not fall"),
        ("hull_error", 0, np.inf, "errors that do not fall"),
        ("hull_error", 0, -1.0, "errors that do not fall"),
        ("hull_error", 0, 0.0, "errors that do not fall"),
        ("hull_length", 0, 0, "hulls that are not in"),
        ("hull_length", 0, 60_000, "hulls that are not in"),
        ("hull_segments", 3, 60_000, "segments that they say"),
        ("n", 0, 0, "counts that the view"),
        ("n", slice(None), 65_535, "counts that the view"),
        ("bin_counts", (0, 0), 200, "more fragments in bins than in their pixel"),
        ("pixel", -1, 40 * 30, "pixels that the view"),
        ("pixel", 1, 0, "pixels that the view"),
        ("pixel", -1, 2**32 - 1, "pixels that the view"),
    ],
)
def test_numbers_that_no_view_has_are_refused_though_their_sums_fit(
    path: Path, tmp_path: Path, column: str, where: Any, value: float, words: str
) -> None:
    with open_columns(path) as file:
        columns, view = file.read(0, file.layout.rows), file.layout.view
    columns[column][where] = value
    write_columns(tmp_path / "wrong", columns, view)
    with pytest.raises(Problem, match=f"wrong is damaged: .*{words}"):
        read_shard(tmp_path / "wrong")


@pytest.mark.parametrize(
    ("layout", "tensors"),
    [
        ({"rows": 10**30}, {}),
        ({"rows": 0, "segments": 0, "first_segments": [0], "blocks": []}, {}),
        ({"block_rows": 1}, {}),
        ({"blocks": []}, {}),
        ({"first_segments": []}, {}),
        ({"first_segments": [10**9, 0]}, {}),
        ({"first_segments": [-5, 0]}, {}),
        ({}, {"features": {"dtype": "F32", "shape": [10**12, 26], "data_offsets": [0, 104 * 10**12]}}),
        ({}, {"features": {"dtype": "F32", "shape": [1, 10**12], "data_offsets": [0, 4]}}),
        ({}, {"n": {"dtype": "U16", "shape": [], "data_offsets": [0, 2]}}),
        ({}, {"n": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}}),
        ({}, {"pixel": None}),
    ],
)
def test_a_header_that_fits_its_sum_but_not_its_rows_is_refused(
    path: Path, tmp_path: Path, layout: dict[str, Any], tensors: dict[str, Any]
) -> None:
    content = path.read_bytes()
    size = 8 + int.from_bytes(content[:8], "little")
    header = json.loads(content[8:size])
    about = json.dumps({**json.loads(header["__metadata__"]["shard"]), **layout})
    header |= {"__metadata__": {"shard": about}, **tensors}
    text = json.dumps({name: entry for name, entry in header.items() if entry is not None}).encode()
    data, prefix = bytearray(content[size:]), len(text).to_bytes(8, "little")
    begin, end = header["header_sha256"]["data_offsets"]
    data[begin:end] = hashlib.sha256(prefix + text).digest()
    (tmp_path / "wrong").write_bytes(prefix + text + data)
    with pytest.raises(Problem, match="wrong is damaged: its"):
        read_shard(tmp_path / "wrong")


def test_a_pipe_and_a_folder_are_no_shards(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder"):
        with pytest.raises(Problem, match=f"{name} is damaged: it is not a file"):
            read_shard(tmp_path / name)


def test_readers_see_the_old_shard_or_the_new_one_while_it_is_replaced(tmp_path: Path) -> None:
    path, stop = tmp_path / "view", threading.Event()
    kinds = []
    for seed in (1, 2):
        random_shard(tmp_path / str(seed), seed)
        with open_columns(tmp_path / str(seed)) as file:
            kinds.append((file.read(0, file.layout.rows), file.layout.view))
    write_columns(path, *kinds[0])

    def write(number: int) -> None:
        while not stop.is_set():
            write_columns(path, *kinds[number], block_rows=16)

    def read(_: int) -> bytes:
        shard, part = read_shard(path), read_rows(path, 10, 40)
        known = [columns["features"] for columns, _ in kinds]
        assert any(np.array_equal(shard.features, features) for features in known)
        assert any(np.array_equal(part.features, features[10:40]) for features in known)
        return shard.features.tobytes()

    with ThreadPoolExecutor(4) as pool:
        writers = [pool.submit(write, number) for number in (0, 1)]
        try:
            seen = set(pool.map(read, range(200)))
        finally:
            stop.set()
        for writer in writers:
            writer.result()
    assert len(seen) == 2, "both were there at some time"
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["1", "2", "view"]
