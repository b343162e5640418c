"""Stage `train`: which shards of the store are its own, and which it replays."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from support.shards import random_shard

from schemas.bundle import WEIGHTS
from schemas.options import Options
from schemas.problem import Problem
from stages.desk import SHARD, Desk
from stages.making import train as training
from stages.plan import Plan
from stages.store import Address, Store
from stages.tasks import Task
from stages.train import TRAIN

PLAN = Plan("glass", (), Options(budgets=(1.0,), width=24, height=24, tail="density", steps=4, network="tiny"))


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return Store(tmp_path_factory.mktemp("state") / "store")


@pytest.fixture(scope="module")
def labels(store: Store) -> list[str]:
    """Shards of an own scene, and of two that were learned before."""
    found = []
    for seed in range(3):
        address = Address("label", "v", (str(seed),))
        with store.put(address) as folder:
            random_shard(folder / SHARD, seed=seed)
        found.append(address.artifact)
    return found


def task(labels: list[str]) -> Task:
    return TRAIN.ask(replace(PLAN, replayed=_pairs(labels[1:])), _pairs(labels[:1]), None)


def _pairs(labels: list[str]) -> tuple[tuple[str, str], ...]:
    return tuple((f"digest of {label}", label) for label in labels)


def test_shards_that_are_replayed_are_no_scenes_of_its_own(
    store: Store, labels: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    handed: list[Any] = []

    def heard(*arguments: Any) -> Any:
        views, replay = arguments[0], arguments[6]
        handed.append(([view.asset for view in views], [view.asset for view in replay]))
        return real(*arguments)

    real = training.train
    monkeypatch.setattr(training, "train", heard)
    asked = task(labels)
    desk = Desk(store, lambda source: Path())
    facts = training.make(desk, asked, TRAIN.params_of(asked), tmp_path, lambda fraction, note: None)
    own, *replayed = (f"digest of {label}" for label in labels)
    assert handed == [([own], replayed)]
    assert (tmp_path / WEIGHTS).is_file()
    assert facts.history


def test_a_replayed_shard_that_is_damaged_is_named(store: Store, labels: list[str], tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(store.fetch(labels[2]), copy)
    content = bytearray((copy / SHARD).read_bytes())
    content[-1] ^= 1
    (copy / SHARD).write_bytes(content)
    desk: Any = SimpleNamespace(
        store=SimpleNamespace(fetch=lambda label: copy if label == labels[2] else store.fetch(label))
    )
    asked = task(labels)
    with pytest.raises(Problem, match="damaged"):
        training.make(desk, asked, TRAIN.params_of(asked), tmp_path, lambda fraction, note: None)
