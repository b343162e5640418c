"""Training learns, is deterministic, and continues exactly where it was killed."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.training import random_view, random_weights

from trainer.adam import Adam
from trainer.checkpoint import load_checkpoint
from trainer.dataset import GROUP, ViewData
from trainer.evaluate import evaluate, evaluate_view, geometric_mean
from trainer.models import GainCurve
from trainer.train import TrainConfig, TrainResult, train
from trainer.weights import Weights

CONFIG = TrainConfig(steps=60, batch=4 * GROUP, validate_every=20, threads=1)
EVERY_STEP = {"checkpoint_seconds": 1e-9}


@pytest.fixture(scope="module")
def data() -> tuple[list[ViewData], list[ViewData]]:
    return [random_view("a", 1), random_view("b", 2)], [random_view("c", 3)]


@pytest.fixture(scope="module")
def result(data: tuple[list[ViewData], list[ViewData]]) -> TrainResult:
    return train(*data, CONFIG)


def assert_same(one: Weights, two: Weights) -> None:
    for (w1, b1), (w2, b2) in zip(one.layers, two.layers, strict=True):
        np.testing.assert_array_equal(w1, w2)
        np.testing.assert_array_equal(b1, b2)


def test_training_comes_nearer_to_the_optimum(data: tuple[list[ViewData], list[ViewData]]) -> None:
    trained = train(*data, CONFIG.model_copy(update={"steps": 200, "validate_every": 100}))
    untrained = train(*data, CONFIG.model_copy(update={"steps": 1, "validate_every": 1}))
    excess = [geometric_mean(evaluate(found.weights, data[1])) - 1.0 for found in (trained, untrained)]
    assert excess[0] < 0.7 * excess[1]


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


def test_features_that_never_change_are_not_read(data: tuple[list[ViewData], list[ViewData]]) -> None:
    views = [replace(view, features=view.features.copy()) for view in data[0]]
    for view in views:
        view.features[:, 2] = 0.33
    weights = train(views, data[1], CONFIG.model_copy(update={"steps": 1})).weights
    assert len(weights.features) == 25
    assert "alpha_mean" not in weights.features


def test_evaluation_is_exact_for_a_predictor_that_knows_the_hull() -> None:
    view = random_view("a", 9)
    scores = evaluate_view(random_weights(0), view, [*view.anchors, -100.0])
    assert all(score.ratio >= 1.0 - 1e-9 for score in scores)
    assert all(score.error >= score.optimum for score in scores[:2])
    assert scores[0].budget < scores[1].budget < scores[2].budget
    assert scores[2].optimum == 0.0, "at a price near 0 the optimum keeps everything that matters"


def test_missing_checkpoint_is_none(tmp_path: Path) -> None:
    model = GainCurve.from_weights(random_weights(0))
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
