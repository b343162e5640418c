"""What is in a data set, counted."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.shards import random_dataset, random_shard

from labeller.dataset import open_dataset
from labeller.inspection import Bin, hull_slopes, inspect
from labeller.shards import read_shard
from schemas.problem import ExitCode, Problem


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    random_dataset(folder)
    return folder


def counted(bins: tuple[Bin, ...], values: np.ndarray[tuple[int], np.dtype[np.float64]]) -> None:
    for number, bin_ in enumerate(bins):
        last = number == len(bins) - 1
        inside = (values >= bin_.low) & ((values <= bin_.high) if last else (values < bin_.high))
        assert bin_.count == np.count_nonzero(inside)
    assert sum(bin_.count for bin_ in bins) == len(values)


def test_counts_and_histograms_are_those_of_the_rows(folder: Path) -> None:
    found = inspect(folder)
    assert found.indexed
    shards = list(open_dataset(folder).shards())
    train = [shard for entry, shard in shards if entry.split == "train"]
    assert list(found.splits) == ["train", "held-out"]
    split = found.splits["train"]
    assert (split.shards, split.assets) == (3, ("box", "town"))
    assert split.rows == sum(len(shard.n) for shard in train)
    assert split.fragments == sum(shard.meta.fragments for shard in train)
    assert split.segments == sum(len(hull_slopes(shard)) for shard in train)
    assert split.exact_rows == sum(int((np.diff(shard.hull_offsets) == 0).sum()) for shard in train) > 0
    counted(found.n, np.concatenate([shard.n for _, shard in shards]).astype(np.float64))
    counted(found.gains, np.concatenate([hull_slopes(shard) for _, shard in shards]))
    levels = [level for _, shard in shards for level in shard.meta.levels]
    counted(found.budgets, np.array([level.share for level in levels]))
    assert found.short_budgets == sum(level.log_lambda is not None for level in levels) > 0


def test_slopes_are_those_between_the_vertices_of_each_row(tmp_path: Path) -> None:
    random_shard(tmp_path / "view")
    shard = read_shard(tmp_path / "view")
    expected = []
    for row in range(len(shard.n)):
        part = slice(shard.hull_offsets[row], shard.hull_offsets[row + 1])
        vertices = list(zip(shard.hull_k[part].tolist(), shard.hull_error[part].tolist(), strict=True))
        expected += [(e - f) / (j - i) for (i, e), (j, f) in pairwise(vertices)]
    np.testing.assert_allclose(hull_slopes(shard), expected, rtol=1e-12)


def test_long_lists_share_bins_of_powers_of_two(tmp_path: Path) -> None:
    random_shard(tmp_path / "view", max_n=40)
    bins = inspect(tmp_path / "view").n
    edges = [(bin_.low, bin_.high) for bin_ in bins]
    assert edges == [*((n, n + 1) for n in range(1, 9)), (9, 17), (17, 33), (33, 65)]


def test_a_view_in_which_nothing_can_be_gained_has_no_gains(tmp_path: Path) -> None:
    random_shard(tmp_path / "flat", max_n=1)
    found = inspect(tmp_path / "flat")
    assert (found.gains, found.log10_lambda) == ((), None)
    assert [(bin_.low, bin_.high) for bin_ in found.n] == [(1, 2)]
    assert found.splits["all"].exact_rows == found.splits["all"].rows


def test_shards_are_found_below_a_folder_without_an_index(tmp_path: Path) -> None:
    for seed, name in enumerate(("a", "b")):
        (tmp_path / "label" / name).mkdir(parents=True)
        random_shard(tmp_path / "label" / name / "shard.safetensors", seed)
    found = inspect(tmp_path)
    assert not found.indexed
    assert found.splits["all"].shards == 2
    alone = inspect(tmp_path / "label" / "b" / "shard.safetensors")
    assert alone.splits["all"].shards == 1
    assert alone.splits["all"].rows < found.splits["all"].rows


def test_every_damaged_and_missing_shard_is_named(tmp_path: Path) -> None:
    random_dataset(tmp_path)
    path = tmp_path / "box-back.safetensors"
    content = bytearray(path.read_bytes())
    content[-100] ^= 4
    path.write_bytes(content)
    (tmp_path / "town-front.safetensors").unlink()
    with pytest.raises(Problem, match=r"2 of 4 shards .*box-back\.safetensors.*town-front\.safetensors") as caught:
        inspect(tmp_path / "index.json")
    assert caught.value.code is ExitCode.CHECK_FAILED


def test_nothing_to_inspect_is_said(tmp_path: Path) -> None:
    for path, words in ((tmp_path, "no data set in"), (tmp_path / "nowhere", "There is no .*nowhere")):
        with pytest.raises(Problem, match=words) as caught:
            inspect(path)
        assert caught.value.code is ExitCode.NOT_FOUND
