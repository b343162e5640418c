"""The data set of a local build: links to the store's shards beside an index that fits them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.shards import random_shard

from diaphane.local import datasets as local_datasets
from diaphane.local.datasets import write_dataset
from labeller.dataset import open_dataset
from schemas.problem import Problem
from schemas.view import View
from stages.label import Shard

CODE = "a" * 64


class Build:
    """Labelled views whose shards lie in a folder."""

    def __init__(self, store: Path) -> None:
        self.store = SimpleNamespace(fetch=lambda artifact: store / artifact)
        self.views: list[Any] = []
        for number, (label, held_out) in enumerate((("a/box", False), ("town", False), ("glass", True))):
            (store / label).mkdir(parents=True)
            written = random_shard(store / label / "shard.safetensors", number)
            scene = SimpleNamespace(label=label, held_out=held_out, digest=f"{number:064x}")
            camera = View(name="/cam 1", eye=(0.0, 0.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0))
            rendered = SimpleNamespace(view=camera)
            task = SimpleNamespace(artifact=label, version=CODE)
            facts = SimpleNamespace(shard=Shard(sha256=written.sha256, bytes=written.bytes))
            self.views.append(SimpleNamespace(scene=scene, rendered=rendered, task=task, facts=facts))

    def write(self, folder: Path, views: slice = slice(None)) -> None:
        write_dataset(folder, self.views[views], self.store)  # type: ignore[arg-type]


@pytest.fixture
def made(tmp_path: Path) -> Build:
    return Build(tmp_path / "store")


def test_the_data_set_says_where_its_rows_are_from(made: Build, tmp_path: Path) -> None:
    made.write(tmp_path / "set")
    dataset = open_dataset(tmp_path / "set")
    assert dataset.index.code == CODE
    assert [(entry.asset, entry.split) for entry in dataset.index.shards] == [
        *[("a/box", "train"), ("town", "train")],
        ("glass", "held-out"),
    ]
    for entry in dataset.index.shards:
        assert entry.source.view == "/cam 1"
        assert entry.file == f"{entry.asset.replace('/', '_')}-_cam_1-{entry.sha256[:12]}.safetensors"
        assert (tmp_path / "set" / entry.file).samefile(tmp_path / "store" / entry.asset / "shard.safetensors")
        dataset.check(entry)


def test_the_same_again_writes_nothing_and_another_build_leaves_its_own_shards_alone(
    made: Build, tmp_path: Path
) -> None:
    folder = tmp_path / "set"
    made.write(folder)
    before = {path.name: path.stat().st_ino for path in folder.iterdir()}
    made.write(folder)
    assert {path.name: path.stat().st_ino for path in folder.iterdir()} == before
    made.write(folder, slice(1, None))
    index = open_dataset(folder).index
    assert {path.name for path in folder.iterdir()} == {"index.json", *(entry.file for entry in index.shards)}
    assert len(index.shards) == 2


def test_where_there_are_no_links_shards_are_copied(
    made: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(source: object, target: object) -> None:
        raise OSError("no links here")

    monkeypatch.setattr(local_datasets.os, "link", refuse)
    made.write(tmp_path / "set")
    dataset = open_dataset(tmp_path / "set")
    for entry in dataset.index.shards:
        assert (tmp_path / "set" / entry.file).stat().st_nlink == 1
        dataset.check(entry)


def test_a_damaged_copy_is_replaced_and_a_damaged_shard_in_the_store_is_named(made: Build, tmp_path: Path) -> None:
    folder = tmp_path / "set"
    made.write(folder)
    (entry, *_) = open_dataset(folder).index.shards
    copy, stored = folder / entry.file, tmp_path / "store" / entry.asset / "shard.safetensors"
    copy.unlink()
    copy.write_bytes(b"\0" * entry.bytes)
    made.write(folder)
    open_dataset(folder).check(entry)
    copy.unlink()
    content = bytearray(stored.read_bytes())
    content[-50] ^= 1
    stored.write_bytes(content)
    with pytest.raises(Problem, match=r"store/a/box/shard\.safetensors is damaged"):
        made.write(folder)
