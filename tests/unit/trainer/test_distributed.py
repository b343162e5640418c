"""Two processes train what one does, but for rounding; a kill of both continues at their checkpoint."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.shards import random_dataset
from support.training import random_view

from schemas.problem import Problem
from trainer.dataset import GROUP
from trainer.distributed import dataset_views
from trainer.log import read_log
from trainer.train import TrainConfig, train
from trainer.weights import Weights, load_weights

CONFIG = TrainConfig(steps=40, batch=5 * GROUP, validate_every=20, validation_rows=200)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("set")
    random_dataset(folder)
    return folder


@pytest.fixture(scope="module")
def alone(dataset: Path) -> Weights:
    return train(dataset_views(dataset), (), CONFIG).weights


def together(dataset: Path, folder: Path, config: TrainConfig, processes: int = 2) -> Weights:
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", f"--nproc-per-node={processes}"]
    files = {option: str(folder / name) for option, name in (("--out", "w"), ("--checkpoint", "c"), ("--jsonl", "l"))}
    wanted = ["-m", "trainer.distributed", str(dataset), "--config", config.model_dump_json()]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    command = [*torchrun, *wanted, *(text for pair in files.items() for text in pair)]
    subprocess.run(command, env=environment, check=True, capture_output=True, timeout=120)
    return load_weights(folder / "w")


def largest_difference(one: Weights, two: Weights) -> float:
    pairs = [(x, y) for a, b in zip(one.layers, two.layers, strict=True) for x, y in zip(a, b, strict=True)]
    return max(float(np.abs(x - y).max() / np.abs(x).max()) for x, y in pairs)


@pytest.mark.dear
def test_two_processes_train_what_one_does(dataset: Path, alone: Weights, tmp_path: Path) -> None:
    # Five groups: one process has three of them, the other two.
    assert largest_difference(alone, together(dataset, tmp_path, CONFIG)) < 1e-4
    lines = read_log(tmp_path / "l")
    assert [line.step for line in lines] == [20, 40]
    other = train(dataset_views(dataset), (), CONFIG.model_copy(update={"seed": 1})).weights
    assert largest_difference(alone, other) > 1e-2


@pytest.mark.dear
def test_two_processes_continue_from_the_checkpoint_of_one(dataset: Path, alone: Weights, tmp_path: Path) -> None:
    class Killed(Exception):
        pass

    def kill(step: int, *_: object) -> None:
        if step == 20:
            raise Killed

    soon = CONFIG.model_copy(update={"checkpoint_seconds": 1e-9})
    with pytest.raises(Killed):
        train(dataset_views(dataset), (), soon, kill, tmp_path / "c", log=tmp_path / "l")
    assert largest_difference(alone, together(dataset, tmp_path, CONFIG)) < 1e-4
    assert [line.step for line in read_log(tmp_path / "l")] == [20, 40]


def test_more_processes_than_groups_are_refused() -> None:
    class Five:
        rank, size = 0, 5

        def add(self, tensors: object) -> None:
            raise AssertionError

        def agreed(self, value: float) -> float:
            raise AssertionError

    with pytest.raises(Problem, match="4 groups for 5 processes"):
        train([random_view("a", 1)], (), TrainConfig(batch=4 * GROUP), team=Five())


def test_held_out_shards_are_not_read(dataset: Path) -> None:
    held_out = {s["asset"] for s in json.loads((dataset / "index.json").read_text())["shards"] if s["split"] != "train"}
    assert held_out
    assert not held_out & {view.asset for view in dataset_views(dataset)}
