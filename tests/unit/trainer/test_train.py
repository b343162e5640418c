"""Training learns, is deterministic, and continues exactly where it was killed."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from support.training import random_view, random_weights

from renderer.features import FEATURES
from trainer.adam import Adam
from trainer.checkpoint import load_checkpoint
from trainer.dataset import GROUP, ViewData
from trainer.evaluate import evaluate, evaluate_view, geometric_mean
from trainer.log import read_log
from trainer.models import Network
from trainer.train import TrainConfig, TrainResult, stopping_assets, train
from trainer.weights import Weights

CONFIG = TrainConfig(steps=60, batch=4 * GROUP, validate_every=20, threads=1)
EVEN = 0.33
"""Opacity of all fragments: with random ones a few pixels decide a score, and it says nothing of others."""
EVERY_STEP = {"checkpoint_seconds": 1e-9}


@pytest.fixture(scope="module")
def data() -> tuple[list[ViewData], list[ViewData]]:
    return [random_view("a", 1, alpha=EVEN), random_view("b", 2, alpha=EVEN)], [random_view("c", 3, alpha=EVEN)]


@pytest.fixture(scope="module")
def result(data: tuple[list[ViewData], list[ViewData]]) -> TrainResult:
    return train(*data, CONFIG)


def assert_same(one: Weights, two: Weights) -> None:
    for (w1, b1), (w2, b2) in zip(one.layers, two.layers, strict=True):
        np.testing.assert_array_equal(w1, w2)
        np.testing.assert_array_equal(b1, b2)


def test_training_comes_nearer_to_the_optimum(data: tuple[list[ViewData], list[ViewData]]) -> None:
    trained = train(*data, CONFIG.model_copy(update={"steps": 400, "validate_every": 100}))
    untrained = train(*data, CONFIG.model_copy(update={"steps": 1, "validate_every": 1}))
    excess = [geometric_mean(evaluate(found.weights, data[1])) - 1.0 for found in (trained, untrained)]
    assert excess[0] < 0.7 * excess[1]


def test_a_network_learns_more_than_the_tail_tells_by_itself() -> None:
    views, unseen = ([random_view(f"view {i}", i, alpha=EVEN) for i in seeds] for seeds in (range(1, 9), range(77, 81)))
    trained = train(views, (), CONFIG.model_copy(update={"steps": 800, "validate_every": 800})).weights
    constant = [(np.zeros_like(weight), np.zeros_like(bias)) for weight, bias in trained.layers]
    constant[-1][1][-1] = math.log(math.expm1(1.0))
    prior = replace(trained, layers=tuple(constant))
    answers = prior.run(unseen[0].features)
    assert not answers[:, :-1].any(), "no bin is above what the tail tells"
    np.testing.assert_allclose(answers[:, -1], 1.0, rtol=1e-6)
    excess = [geometric_mean(evaluate(weights, unseen)) - 1.0 for weights in (trained, prior)]
    assert excess[0] < 0.8 * excess[1]


def test_the_same_seed_gives_the_same_weights(data: tuple[list[ViewData], list[ViewData]], result: TrainResult) -> None:
    again = train(*data, CONFIG)
    assert_same(result.weights, again.weights)
    assert again.history == result.history
    other = train(*data, CONFIG.model_copy(update={"seed": 1}))
    assert not np.array_equal(other.weights.layers[0][0], result.weights.layers[0][0])


def test_the_best_state_is_kept(result: TrainResult, data: tuple[list[ViewData], list[ViewData]]) -> None:
    assert result.score == min(step.score for step in result.history)
    assert geometric_mean(evaluate(result.weights, data[1])) == pytest.approx(result.score)


def test_a_training_can_begin_with_the_weights_of_another(
    data: tuple[list[ViewData], list[ViewData]], tmp_path: Path
) -> None:
    first = train(*data, CONFIG.model_copy(update={"steps": 200, "validate_every": 100}))
    short = CONFIG.model_copy(update={"steps": 5, "validate_every": 5, "lr": 0.25 * CONFIG.lr})
    tuned = train(*data, short, start=first.weights)
    assert tuned.score < train(*data, short).score
    assert tuned.weights.features == first.weights.features
    np.testing.assert_array_equal(tuned.weights.mean, first.weights.mean)
    # A checkpoint of the training from scratch is not that of this one.
    path = tmp_path / "checkpoint.safetensors"
    train(*data, short, checkpoint=path)
    assert_same(train(*data, short, checkpoint=path, start=first.weights).weights, tuned.weights)


def test_a_killed_training_continues_exactly(
    data: tuple[list[ViewData], list[ViewData]], result: TrainResult, tmp_path: Path
) -> None:
    def kill(step: int, steps: int, loss: float, score: float) -> None:
        if step == 40:
            raise KeyboardInterrupt

    path = tmp_path / "state.safetensors"
    with pytest.raises(KeyboardInterrupt):
        train(*data, CONFIG.model_copy(update=EVERY_STEP), kill, path)
    seen: list[int] = []
    resumed = train(*data, CONFIG, lambda step, *_: seen.append(step), path)
    assert seen == [40, 50, 60], "the step after the last checkpoint is done again, those before are not"
    assert_same(resumed.weights, result.weights)
    assert resumed.history == result.history


def test_a_finished_training_is_not_repeated(data: tuple[list[ViewData], list[ViewData]], tmp_path: Path) -> None:
    path = tmp_path / "state.safetensors"
    first = train(*data, CONFIG, checkpoint=path)
    seen: list[int] = []
    assert_same(train(*data, CONFIG, lambda step, *_: seen.append(step), path).weights, first.weights)
    assert not seen


def test_a_checkpoint_of_other_data_or_settings_is_not_continued(
    data: tuple[list[ViewData], list[ViewData]], result: TrainResult, tmp_path: Path
) -> None:
    path = tmp_path / "state.safetensors"
    train([data[0][0]], data[1], CONFIG, checkpoint=path)
    assert_same(train(*data, CONFIG, checkpoint=path).weights, result.weights)


@pytest.mark.parametrize("content", [b"", b"\x08\0\0\0\0\0\0\0garbage!", b"\xff" * 64])
def test_a_damaged_checkpoint_is_not_continued(
    content: bytes, data: tuple[list[ViewData], list[ViewData]], result: TrainResult, tmp_path: Path
) -> None:
    path = tmp_path / "state.safetensors"
    path.write_bytes(content)
    assert_same(train(*data, CONFIG, checkpoint=path).weights, result.weights)


def test_features_that_never_change_are_not_read(
    data: tuple[list[ViewData], list[ViewData]], result: TrainResult
) -> None:
    views = [replace(view, features=view.features.copy()) for view in data[0]]
    for view in views:
        view.features[:, FEATURES.index("luma_mean")] = 0.33
    weights = train(views, data[1], CONFIG.model_copy(update={"steps": 1})).weights
    assert set(result.weights.features) - set(weights.features) == {"luma_mean"}


def test_evaluation_is_exact_for_a_predictor_that_knows_the_hull() -> None:
    view = random_view("a", 9)
    scores = evaluate_view(random_weights(0), view, [*view.anchors, -100.0])
    assert all(score.ratio >= 1.0 - 1e-9 for score in scores)
    assert all(score.error >= score.optimum for score in scores[:2])
    assert scores[0].budget < scores[1].budget < scores[2].budget
    assert scores[2].optimum == 0.0, "at a price near 0 the optimum keeps everything that matters"


def test_a_training_stops_when_the_assets_kept_out_get_no_better() -> None:
    views = [random_view(asset, seed) for seed, asset in enumerate("aabcd")]
    config = CONFIG.model_copy(update={"steps": 400, "validate_every": 5, "patience": 2, "lr": 0.5})
    stopped = train(views, (), config)
    assert len(stopped.kept_out) == 1
    assert stopped.history[-1].step < 400
    scores = [point.score for point in stopped.history]
    assert min(scores[:-2]) <= min(scores[-2:])
    assert stopped.score == min(scores)
    judges = [view for view in views if view.asset in stopped.kept_out]
    assert geometric_mean(evaluate(stopped.weights, judges)) == pytest.approx(stopped.score)


def test_a_stopped_training_is_not_taken_up_again(tmp_path: Path) -> None:
    views = [random_view(asset, seed) for seed, asset in enumerate("abcd")]
    config = CONFIG.model_copy(update={"steps": 400, "validate_every": 5, "patience": 1, "lr": 0.5})
    first = train(views, (), config, checkpoint=tmp_path / "c")
    seen: list[int] = []
    again = train(views, (), config, lambda step, *_: seen.append(step), tmp_path / "c")
    assert not seen
    assert again.history == first.history


@pytest.mark.parametrize(("assets", "count"), [("aab", 0), ("abc", 1), ("abcdefghij", 2)])
def test_assets_to_stop_by_are_whole_and_a_share_of_all(assets: str, count: int) -> None:
    chosen = stopping_assets(list(assets), 5, seed=3)
    assert len(chosen) == count
    assert set(chosen) <= set(assets)
    assert chosen == stopping_assets(sorted(assets, reverse=True), 5, seed=3)


@pytest.mark.dear
def test_replayed_assets_are_not_forgotten() -> None:
    old, new = [random_view("old", 1, alpha=EVEN)], [random_view("new", 2, alpha=EVEN)]
    new[0].features[:] *= -1.0  # the same curves, said in other words
    began = train(old, (), CONFIG.model_copy(update={"steps": 500, "validate_every": 100}))
    config = CONFIG.model_copy(update={"steps": 500, "validate_every": 500})
    without, with_replay = (train(new, (), config, start=began.weights, replay=replay).weights for replay in ((), old))
    before, lost, kept = (geometric_mean(evaluate(found, old)) for found in (began.weights, without, with_replay))
    assert kept < 1.1 * before < 0.8 * lost


def test_the_log_says_how_it_went(data: tuple[list[ViewData], list[ViewData]], tmp_path: Path) -> None:
    result = train(*data, CONFIG, log=tmp_path / "log.jsonl")
    lines = read_log(tmp_path / "log.jsonl")
    assert [line.step for line in lines] == [20, 40, 50, 60]
    assert [(x.step, x.loss, x.score) for x in lines if x.score is not None] == [
        (x.step, x.loss, x.score) for x in result.history
    ]
    assert all(earlier.lr > later.lr for earlier, later in pairwise(lines))
    assert all(earlier.seconds < later.seconds for earlier, later in pairwise(lines))
    assert min(line.rows_per_second for line in lines) > 0.0


def test_a_log_that_was_cut_off_is_continued(data: tuple[list[ViewData], list[ViewData]], tmp_path: Path) -> None:
    def kill(step: int, *_: object) -> None:
        if step == 50:
            raise KeyboardInterrupt

    log, path = tmp_path / "log.jsonl", tmp_path / "c"
    with pytest.raises(KeyboardInterrupt):
        train(*data, CONFIG.model_copy(update=EVERY_STEP), kill, path, log=log)
    log.write_text(log.read_text() + '{"step": 50, "lo')
    train(*data, CONFIG, checkpoint=path, log=log)
    assert [line.step for line in read_log(log)] == [20, 40, 50, 60]


def test_hard_views_are_drawn_more_often_and_the_state_of_that_is_kept(
    data: tuple[list[ViewData], list[ViewData]], tmp_path: Path
) -> None:
    config = CONFIG.model_copy(update={"mining": 0.8})
    whole = train(*data, config)
    assert whole.history != train(*data, CONFIG).history

    def kill(step: int, *_: object) -> None:
        if step == 50:
            raise KeyboardInterrupt

    path = tmp_path / "c"
    with pytest.raises(KeyboardInterrupt):
        train(*data, config.model_copy(update=EVERY_STEP), kill, path)
    assert_same(train(*data, config, checkpoint=path).weights, whole.weights)


def test_missing_checkpoint_is_none(tmp_path: Path) -> None:
    model = Network.from_weights(random_weights(0))
    optimiser = Adam(model.parameters())
    assert load_checkpoint(tmp_path / "none", "key", model, optimiser) is None


def test_training_imports_no_compiler() -> None:
    """Beside an open llvmpipe context torch's compiler crashes the process (its LLVM against the driver's)."""
    code = (
        "import sys; from support.training import random_view; from trainer.train import TrainConfig, train;"
        "view = random_view('a', 1); train([view], [], TrainConfig(steps=2, batch=128));"
        "sys.exit(any(name in sys.modules for name in ('triton', 'torch._dynamo', 'torch._inductor')))"
    )
    root = Path(__file__).parents[3]
    environment = {**os.environ, "PYTHONPATH": f"{root}{os.pathsep}{root / 'tests'}"}
    assert subprocess.run([sys.executable, "-c", code], env=environment, check=False).returncode == 0
