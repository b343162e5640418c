"""Rows that stay on disk: the same batches as from memory, and memory that does not grow with the data set."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from support.dumps import random_dump

from labeller.curves import error_curves
from labeller.hull import lower_hulls
from labeller.shard_file import BLOCK_ROWS
from labeller.shards import write_shard
from schemas.problem import Problem
from trainer.dataset import GROUP, ViewData, load_shards, sample_batch
from trainer.train import TrainConfig, train
from trainer.views import LEAST_BLOCKS, Pool, ShardView, open_views

SIDE = 150
ASSETS = ("a", "a", "b", "c")


@pytest.fixture(scope="module")
def shards(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("shards")
    paths = []
    for number in range(len(ASSETS)):
        dump = random_dump(SIDE, SIDE, 6, seed=number)
        curves = error_curves(dump)
        path = folder / f"{number}.safetensors"
        write_shard(path, dump, curves, lower_hulls(curves), [dump.total // 3], fraction=1.0, seed=2)
        paths.append(path)
    return paths


@pytest.fixture(scope="module")
def in_memory(shards: list[Path]) -> list[ViewData]:
    return load_shards(shards, ASSETS)


@pytest.fixture(scope="module")
def on_disk(shards: list[Path]) -> list[ShardView]:
    return open_views(shards, ASSETS)


def assert_same(one: ViewData, two: ViewData) -> None:
    assert (one.asset, one.price_range) == (two.asset, two.price_range)
    assert one.sampled_pixels == pytest.approx(two.sampled_pixels)
    for name in ("features", "n", "offsets", "slopes", "lengths", "anchors", "price_grid", "scale_grid"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))


def test_what_is_known_of_a_view_is_the_same(in_memory: list[ViewData], on_disk: list[ShardView]) -> None:
    assert min(view.rows for view in in_memory) > 3 * BLOCK_ROWS
    for held, stored in zip(in_memory, on_disk, strict=True):
        assert (held.asset, held.rows, held.price_range) == (stored.asset, stored.rows, stored.price_range)
        assert held.digest() == stored.digest()
        for one, two in zip(held.moments(), stored.moments(), strict=True):
            np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("chosen", [[0], [1, 2], [0, 2, 3], None])
def test_blocks_are_the_same(chosen: list[int] | None, in_memory: list[ViewData], on_disk: list[ShardView]) -> None:
    blocks = None if chosen is None else np.array(chosen, dtype=np.int64)
    assert_same(in_memory[1].blocks(blocks), on_disk[1].blocks(blocks))
    assert_same(in_memory[1].subset(100, 3), on_disk[1].subset(100, 3))


@pytest.mark.parametrize("rows", [2 * LEAST_BLOCKS * BLOCK_ROWS, 10**9])
def test_batches_are_the_same(rows: int, in_memory: list[ViewData], on_disk: list[ShardView]) -> None:
    held, stored = Pool(in_memory, rows, 2, seed=4), Pool(on_disk, rows, 2, seed=4)
    for step in (0, 1, 2, 5):
        assert [number for number, _ in held.at(step)] == [number for number, _ in stored.at(step)]
        one, two = (
            sample_batch([view for _, view in pool.at(step)], [0, 5], (4, step), 8 * GROUP) for pool in (held, stored)
        )
        np.testing.assert_array_equal(one.features, two.features)
        np.testing.assert_array_equal(one.slopes, two.slopes)
        np.testing.assert_array_equal(one.log_lambda, two.log_lambda)
        np.testing.assert_array_equal(one.scale, two.scale)


def test_a_training_is_the_same_from_disk(in_memory: list[ViewData], on_disk: list[ShardView]) -> None:
    config = TrainConfig(
        steps=8, batch=2 * GROUP, validate_every=4, pool_rows=2 * LEAST_BLOCKS * BLOCK_ROWS, pool_steps=3
    )
    held, stored = train(in_memory, (), config), train(on_disk, (), config)
    assert held.history == stored.history
    for (w1, b1), (w2, b2) in zip(held.weights.layers, stored.weights.layers, strict=True):
        np.testing.assert_array_equal(w1, w2)
        np.testing.assert_array_equal(b1, b2)


def test_all_rows_are_drawn_from_where_they_fit(on_disk: list[ShardView]) -> None:
    pool = Pool(on_disk, sum(view.rows for view in on_disk), 1, seed=0)
    first = pool.at(0)
    assert [number for number, _ in first] == [0, 1, 2, 3]
    assert pool.at(7) is first


def test_a_pool_has_no_more_rows_than_it_may_and_every_asset_in_turn(on_disk: list[ShardView]) -> None:
    room = 2 * LEAST_BLOCKS * BLOCK_ROWS
    pool, seen = Pool(on_disk, room, 1, seed=1), set()
    for step in range(6):
        drawn = pool.at(step)
        assert len({view.asset for _, view in drawn}) == 2, "two views have room: they are of two assets"
        assert 0 < sum(view.rows for _, view in drawn) <= room
        seen |= {number for number, _ in drawn}
    assert seen == {0, 1, 2, 3}


def test_memory_does_not_grow_with_the_data_set(shards: list[Path]) -> None:
    """Twelve times the views in the same pool: what is known of a view is small, its rows are not."""

    def peak(times: int) -> int:
        tracemalloc.start()
        try:
            views = open_views(shards * times, ASSETS * times)
            pool = Pool(views, LEAST_BLOCKS * BLOCK_ROWS, 1, seed=0)
            for step in range(3):
                sample_batch([view for _, view in pool.at(step)], [0], (0, step), GROUP)
            return tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()

    few, many = peak(1), peak(12)
    whole = 12 * sum(path.stat().st_size for path in shards)
    assert many < 1.5 * few
    assert many < 0.5 * whole


def test_a_shard_that_is_damaged_later_is_named(shards: list[Path], tmp_path: Path) -> None:
    copy = tmp_path / "copy.safetensors"
    copy.write_bytes(shards[0].read_bytes())
    (view,) = open_views([copy], ["a"])
    content = bytearray(copy.read_bytes())
    content[-10] ^= 1
    copy.write_bytes(content)
    with pytest.raises(Problem, match=r"copy\.safetensors"):
        view.blocks(None)
