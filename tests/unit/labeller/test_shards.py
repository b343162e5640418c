"""Label shards: what a row holds, and that damage is found."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from support.dumps import random_dump

from labeller.curves import error_curves
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from labeller.shards import Shard, read_shard, stratified_sample, write_shard
from renderer.features import FEATURES, derive, gather
from schemas.problem import Problem

DUMP = random_dump(40, 30, 8, seed=1)
CURVES = error_curves(DUMP)
HULLS = lower_hulls(CURVES, 1)
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
    features = derive(gather(DUMP))
    assert shard.features.shape == (len(shard.n), len(FEATURES))
    assert np.array_equal(shard.features, features[shard.pixel])
    assert np.array_equal(shard.n, DUMP.counts[shard.pixel])
    for row, p in enumerate(shard.pixel):
        mine = slice(shard.hull_offsets[row], shard.hull_offsets[row + 1])
        theirs = slice(HULLS.offsets[p], HULLS.offsets[p + 1])
        assert np.array_equal(shard.hull_k[mine], HULLS.k[theirs])
        assert np.array_equal(shard.hull_error[mine], HULLS.error[theirs])


def test_a_fifth_of_the_pixels_that_can_get_more_is_sampled(shard: Shard) -> None:
    eligible = int(np.count_nonzero(DUMP.counts > HULLS.k_min))
    assert shard.meta.eligible == eligible
    assert len(shard.n) == pytest.approx(0.2 * eligible, abs=1)
    assert (DUMP.counts[shard.pixel] > HULLS.k_min).all()
    assert shard.sampled_pixels == pytest.approx(0.2 * DUMP.pixels, rel=0.02)


def test_levels_are_those_of_the_optimum(shard: Shard) -> None:
    assert [x.budget for x in shard.meta.levels] == sorted({x.budget for x in shard.meta.levels})
    assert [x.budget for x in shard.meta.levels if x.scored] == [b for b in BUDGETS if b < DUMP.total]
    for level in shard.meta.levels:
        (found,) = allocate_curves(DUMP, CURVES, [level.budget], "optimal")
        assert (level.error, level.bound, level.k_min) == (found.error, found.bound, found.k_min)
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


def test_a_view_in_which_nothing_can_be_gained_has_no_rows(tmp_path: Path) -> None:
    dump = random_dump(4, 4, 1, seed=0)
    curves = error_curves(dump)
    write_shard(tmp_path / "flat", dump, curves, lower_hulls(curves, 1), [dump.pixels])
    shard = read_shard(tmp_path / "flat")
    assert len(shard.n) == 0
    assert shard.price_range == (0.0, 0.0)


@pytest.mark.parametrize("where", [0.0, 0.001, 0.02, 0.3, 0.7, 0.999])
def test_a_changed_byte_is_found_and_the_file_is_named(path: Path, tmp_path: Path, where: float) -> None:
    content = bytearray(path.read_bytes())
    content[int(where * len(content))] ^= 0x11
    damaged = tmp_path / "damaged.safetensors"
    damaged.write_bytes(content)
    with pytest.raises(Problem, match=r"damaged\.safetensors is damaged"):
        read_shard(damaged)


@pytest.mark.parametrize("size", [0, 7, 5000])
def test_a_cut_off_file_is_found(path: Path, tmp_path: Path, size: int) -> None:
    (tmp_path / "cut").write_bytes(path.read_bytes()[:size])
    with pytest.raises(Problem, match="cut is damaged"):
        read_shard(tmp_path / "cut")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(Problem, match=r"no label shard .*nowhere"):
        read_shard(tmp_path / "nowhere")


def test_the_sample_has_its_share_of_every_n() -> None:
    n = np.repeat([1, 2, 9], [1000, 500, 50])
    sample = stratified_sample(np.arange(len(n)), n, 0.2, seed=3)
    for value, count in ((1, 200), (2, 100), (9, 10)):
        assert abs(np.count_nonzero(n[sample] == value) - count) <= 1
    assert np.array_equal(sample, np.unique(sample))
