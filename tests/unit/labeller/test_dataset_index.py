"""Data sets: the index fits its shards, and whatever does not is named."""

from __future__ import annotations

import json
import os
import shutil
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from support.shards import CODE, member, random_dataset, random_shard

from labeller.dataset import Dataset, open_dataset, read_ahead
from labeller.dataset_index import INDEX, DatasetIndex, read_index, write_index
from labeller.shards import read_shard
from schemas.problem import ExitCode, Problem
from schemas.tail import DEFAULT_TAIL


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    random_dataset(folder)
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    """A copy of it, elsewhere."""
    return Path(shutil.copytree(made, tmp_path / "elsewhere"))


def test_the_index_says_what_the_shards_are(folder: Path) -> None:
    index = read_index(folder / INDEX)
    assert index == read_index(folder)
    assert index.code == CODE
    assert index.labels.tail == DEFAULT_TAIL
    assert (index.sampling.kind, index.sampling.fraction, index.sampling.seed) == ("stratified", 0.5, 0)
    assert [column.name for column in index.columns][:2] == ["features", "n"]
    for entry in index.shards:
        shard = read_shard(folder / entry.file)
        assert (entry.rows, entry.segments) == (len(shard.n), shard.segments)
        assert entry.bytes == (folder / entry.file).stat().st_size
        assert entry.source.camera.name == entry.source.view
    assert [(entry.asset, entry.split) for entry in index.shards] == [
        *[("box", "train"), ("box", "train"), ("town", "train")],
        ("glass", "held-out"),
    ]


def test_shards_come_in_order_whatever_the_threads(folder: Path) -> None:
    dataset = open_dataset(folder)
    for threads in (1, 3):
        read = list(dataset.shards(threads=threads))
        assert [entry.file for entry, _ in read] == [entry.file for entry in dataset.index.shards]
        for entry, shard in read:
            np.testing.assert_array_equal(shard.features, dataset.read(entry).features)
    assert [entry.asset for entry, _ in dataset.shards("held-out")] == ["glass"]
    first = dataset.index.shards[0]
    np.testing.assert_array_equal(dataset.rows(first, 5, 40).pixel, dataset.read(first).pixel[5:40])


def test_an_equal_index_stays_and_sums_need_not_be_given(folder: Path) -> None:
    index = read_index(folder)
    before = (folder / INDEX).stat()
    members = [member(e.file, e.asset, e.split, view=e.source.view) for e in index.shards]
    assert write_index(folder, members, CODE) == index
    assert (folder / INDEX).stat() == before
    write_index(folder, members[:2], CODE)
    assert len(read_index(folder).shards) == 2


def test_an_asset_in_two_splits_is_refused_when_written_and_when_read(folder: Path) -> None:
    index = read_index(folder)
    members = [member(e.file, e.asset, e.split, e.sha256, e.source.view) for e in index.shards]
    mixed = [*members[:1], member(members[1].file, "box", "held-out", view="back")]
    with pytest.raises(Problem, match="asset box is in two splits, train and held-out"):
        write_index(folder, mixed, CODE)
    # The same scene under another name is the same asset.
    renamed = member(members[1].file, "carton", "held-out", view="back")
    with pytest.raises(Problem, match="scene digest of box is in two splits"):
        write_index(folder, [members[0], type(renamed)(renamed.file, "carton", "held-out", members[0].source)], CODE)
    shards = (index.shards[0], index.shards[1].model_copy(update={"split": "held-out"}))
    (folder / INDEX).write_text(index.model_copy(update={"shards": shards}).text)
    with pytest.raises(Problem, match="asset box is in two splits") as caught:
        open_dataset(folder)
    assert caught.value.code is ExitCode.CHECK_FAILED


def test_a_file_is_in_an_index_once(folder: Path) -> None:
    (first, *_) = read_index(folder).shards
    with pytest.raises(Problem, match=r"box-front\.safetensors is in the data set twice"):
        write_index(folder, [member(first.file, "box", "train")] * 2, CODE)


def test_shards_that_were_made_otherwise_do_not_go_together(folder: Path) -> None:
    random_shard(folder / "odd", kind="uniform")
    with pytest.raises(Problem, match=r"box-front\.safetensors and odd are not labelled in the same way"):
        write_index(folder, [member("box-front.safetensors", "box", "train"), member("odd", "odd", "train")], CODE)


@pytest.mark.parametrize("name", ["../elsewhere", "a/b", "..", ".", ""])
def test_an_index_names_nothing_outside_its_folder(folder: Path, name: str) -> None:
    index = read_index(folder)
    shards = (index.shards[0].model_copy(update={"file": name}),)
    (folder / INDEX).write_text(index.model_copy(update={"shards": shards}).text)
    with pytest.raises(Problem, match=r"index\.json is damaged: shards\.0\.file does not fit"):
        open_dataset(folder)


def test_a_missing_shard_is_named(folder: Path) -> None:
    (folder / "town-front.safetensors").unlink()
    with pytest.raises(Problem, match=r"town-front\.safetensors is missing") as caught:
        open_dataset(folder)
    assert caught.value.code is ExitCode.CHECK_FAILED


def test_a_cut_off_shard_is_named_before_it_is_read(folder: Path) -> None:
    path = folder / "town-front.safetensors"
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(Problem, match=r"town-front\.safetensors is damaged: it has .* bytes instead of"):
        open_dataset(folder)


def test_shards_that_were_swapped_are_found_also_by_a_range(folder: Path) -> None:
    one, other = folder / "box-front.safetensors", folder / "box-back.safetensors"
    content = one.read_bytes(), other.read_bytes()
    one.write_bytes(content[1])
    other.write_bytes(content[0])
    index = read_index(folder)
    dataset = Dataset(folder, index)  # open_dataset would see their sizes
    for read in (lambda: dataset.read(index.shards[0]), lambda: dataset.rows(index.shards[1], 3, 4)):
        with pytest.raises(Problem, match=r"box-.*\.safetensors is damaged: it is not the file that the index names"):
            read()


def test_a_sum_of_the_whole_file_that_does_not_fit_is_found_by_a_check(folder: Path) -> None:
    index = read_index(folder)
    wrong = index.shards[0].model_copy(update={"sha256": "0" * 64})
    (folder / INDEX).write_text(index.model_copy(update={"shards": (wrong,)}).text)
    dataset = open_dataset(folder)
    with pytest.raises(Problem, match=r"box-front\.safetensors is damaged: it does not fit the index"):
        dataset.check(dataset.index.shards[0])


def test_an_index_of_another_version_says_so(folder: Path) -> None:
    described = json.loads((folder / INDEX).read_text())
    (folder / INDEX).write_text(json.dumps({**described, "schema_version": 9}))
    with pytest.raises(Problem, match="has the schema version 9, not 1"):
        read_index(folder)


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b"\xff", b'{"sha256": 1, "schema_version": 1}'])
def test_what_is_no_index_is_named(folder: Path, content: bytes) -> None:
    (folder / INDEX).write_bytes(content)
    with pytest.raises(Problem, match=r"index\.json is damaged"):
        read_index(folder)


def test_there_has_to_be_an_index_and_a_shard(tmp_path: Path) -> None:
    with pytest.raises(Problem, match="There is no index") as caught:
        open_dataset(tmp_path)
    assert caught.value.code is ExitCode.NOT_FOUND
    with pytest.raises(Problem, match="needs a shard"):
        write_index(tmp_path, [], CODE)


def test_many_read_while_the_index_is_written(folder: Path) -> None:
    index, stop = read_index(folder), threading.Event()
    members = [member(e.file, e.asset, e.split, e.sha256, e.source.view) for e in index.shards]

    def write() -> None:
        while not stop.is_set():
            write_index(folder, members[:3], CODE)
            write_index(folder, members, CODE)

    def read(number: int) -> int:
        dataset = open_dataset(folder)
        entry = dataset.index.shards[number % 3]
        assert len(dataset.rows(entry, 0, 20).n) == 20
        return len(dataset.index.shards)

    with ThreadPoolExecutor(4) as pool:
        writer = pool.submit(write)
        try:
            seen = set(pool.map(read, range(150)))
        finally:
            stop.set()
        writer.result()
    assert seen == {3, 4}
    assert not list(folder.glob("*.partial"))


def test_reading_ahead_is_bounded_and_keeps_order() -> None:
    begun: list[int] = []

    def read(item: int) -> int:
        begun.append(item)
        return item * item

    found = read_ahead(read, range(100), threads=2)
    assert next(found) == 0
    assert len(begun) <= 4
    assert list(found) == [n * n for n in range(1, 100)]


@pytest.mark.parametrize(
    "wrong",
    [
        lambda index: {"labels": index.labels.model_copy(update={"metric": "linear"})},
        lambda index: {"sampling": index.sampling.model_copy(update={"seed": 9})},
        lambda index: {"shards": tuple(entry.model_copy(update={"fragments": 1}) for entry in index.shards)},
    ],
)
def test_an_index_that_says_what_the_shards_do_not_is_found_by_the_check(
    folder: Path, wrong: Callable[[DatasetIndex], dict[str, object]]
) -> None:
    index = read_index(folder)
    (folder / INDEX).write_text(index.model_copy(update=wrong(index)).text)
    dataset = open_dataset(folder)
    with pytest.raises(Problem, match="does not fit the index"):
        dataset.check(dataset.index.shards[0])


def test_an_index_of_nothing_and_one_that_is_no_file_are_refused(folder: Path) -> None:
    index = read_index(folder)
    (folder / INDEX).write_text(index.model_copy(update={"shards": ()}).text)
    with pytest.raises(Problem, match="it names no shard"):
        read_index(folder)
    (folder / INDEX).unlink()
    os.mkfifo(folder / INDEX)
    with pytest.raises(Problem, match="it is not a file"):
        read_index(folder)
