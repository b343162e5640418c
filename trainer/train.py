"""Training of the gain-curve head: deterministic by seed, resumable, the best state on held-out assets is kept."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from pydantic import BaseModel, ConfigDict, Field
from torch import Tensor

from renderer.features import FEATURES
from trainer.adam import Adam
from trainer.checkpoint import Checkpoint, Step, data_key, load_checkpoint, save_checkpoint
from trainer.dataset import GROUP, Batch, ViewData, normalisation, sample_batch
from trainer.evaluate import evaluate, geometric_mean
from trainer.loss import lagrangian_regret
from trainer.models import GainCurve
from trainer.weights import Weights

CONSTANT: Final = 1e-4
"""A feature that spreads less than this over the training data says nothing: the model does not read it."""

Progress = Callable[[int, int, float, float], None]
"""Called with (step, steps, loss, latest validation score: geometric mean of error / optimum, NaN before the first)."""

REPORT_EVERY: Final = 50
"""Steps between two calls of the progress callback, which every validation calls too."""


class TrainConfig(BaseModel):
    """What a training depends on, beside its data.

    Attributes:
        seed: Seed of the initial weights and of the batches.
        steps: Steps of Adam; the learning rate falls along a cosine. Longer training fits the training assets better
            and held-out ones no better, some worse.
        batch: Rows per step.
        lr: First learning rate.
        hidden: Units of the hidden layers.
        features: Features that the model may read.
        view_weight: Share of the loss that is the views' regret (sum of squares) rather than the rows' logarithm.
        leak: Weight of the overshoot beyond a clamp.
        validate_every: Steps between validations.
        validation_rows: Rows of each held-out view that are scored.
        threads: Threads of torch. One is nearly as fast for so small a network, and does not depend on the machine.
        checkpoint_seconds: Time between checkpoints.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    seed: int = 0
    steps: int = Field(default=1500, gt=0)
    batch: int = Field(default=4096, ge=GROUP)
    lr: float = Field(default=4e-3, gt=0.0)
    hidden: tuple[int, ...] = (32, 16)
    features: tuple[str, ...] = FEATURES
    view_weight: float = Field(default=0.5, ge=0.0, le=1.0)
    leak: float = Field(default=0.02, ge=0.0)
    validate_every: int = Field(default=500, gt=0)
    validation_rows: int = Field(default=20_000, gt=0)
    threads: int = Field(default=1, gt=0)
    checkpoint_seconds: float = Field(default=10.0, gt=0.0)


@dataclass(frozen=True)
class TrainResult:
    """The best state of a training and how it got there.

    Attributes:
        weights: The weights with the best score.
        score: Their geometric mean of error / optimum on the held-out views.
        history: One entry per validation.
    """

    weights: Weights
    score: float
    history: tuple[Step, ...]


def train(
    views: Sequence[ViewData],
    held_out: Sequence[ViewData],
    config: TrainConfig,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    start: Weights | None = None,
) -> TrainResult:
    """Train a gain-curve network.

    Args:
        views: Training data.
        held_out: Views of other assets, by which the best state is chosen; without any the training views are used.
        config: Everything else.
        progress: Told how it goes.
        checkpoint: File to write the state to from time to time, and to continue from if it belongs to the same
            data and configuration.
        start: Network to begin with, with its features and their normalisation; None: weights drawn by the seed.

    Returns:
        The best state. The same for the same data, configuration and number of threads, interrupted or not.
    """
    with _deterministic(config.threads):
        model = _new_model(views, config) if start is None else GainCurve.from_weights(start)
        columns = model.weights().columns
        validation = [view.subset(config.validation_rows, config.seed) for view in (held_out or views)]
        optimiser = Adam(model.parameters())
        began = config.model_dump_json(exclude={"checkpoint_seconds"}) + ("" if start is None else start.digest())
        key = data_key(began, [*views, *held_out])
        state = Checkpoint.fresh(model)
        if checkpoint is not None:
            state = load_checkpoint(checkpoint, key, model, optimiser) or state
        saved = time.monotonic()
        while state.step < config.steps:
            batch = sample_batch(views, columns, (config.seed, state.step), config.batch)
            loss = batch_loss(model, batch, config)
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step(0.5 * config.lr * (1.0 + math.cos(math.pi * state.step / config.steps)))
            state.step += 1
            if state.step % config.validate_every == 0 or state.step == config.steps:
                score = geometric_mean(evaluate(model.weights(), validation))
                state.record(model, float(loss.detach()), score)
            validated = bool(state.history) and state.history[-1].step == state.step
            if progress is not None and (validated or state.step % REPORT_EVERY == 0):
                score = state.history[-1].score if state.history else math.nan
                progress(state.step, config.steps, float(loss.detach()), score)
            if checkpoint is not None and time.monotonic() - saved > config.checkpoint_seconds:
                save_checkpoint(checkpoint, key, state, model, optimiser)
                saved = time.monotonic()
        if checkpoint is not None:
            save_checkpoint(checkpoint, key, state, model, optimiser)
        model.load_state_dict(state.best)
        return TrainResult(model.weights(), state.best_score, tuple(state.history))


def batch_loss(model: GainCurve, batch: Batch, config: TrainConfig) -> Tensor:
    """Loss of a batch, a scalar.

    Rows: `mean log(1 + r)`. Views: the error of an allocation is the sum of its rows', dominated by few of them;
    `log(1 + mean r / mean (E* / lambda))` is the logarithm of a view's Lagrangian over its optimum's, which is what
    is scored.
    """
    features, n, k_min, slopes, lengths, log_lambda, scale = (
        torch.from_numpy(array)
        for array in (
            *(batch.features, batch.n, batch.k_min, batch.slopes, batch.lengths),
            *(batch.log_lambda, batch.scale),
        )
    )
    a, b = model(features)
    regret, overshoot = lagrangian_regret(a, b, n, k_min, slopes, lengths, log_lambda)
    rows = torch.log1p(torch.relu(regret)).mean()
    views = torch.log1p(torch.relu(regret.view(len(scale), -1).mean(dim=1)) / scale).mean()
    leak = torch.log1p(overshoot).mean()
    return (1.0 - config.view_weight) * rows + config.view_weight * views + config.leak * leak


def _new_model(views: Sequence[ViewData], config: TrainConfig) -> GainCurve:
    mean, std = normalisation(views)
    names = [name for name in FEATURES if name in config.features and std[FEATURES.index(name)] > CONSTANT]
    names = names or [FEATURES[0]]
    columns = [FEATURES.index(name) for name in names]
    torch.manual_seed(config.seed)
    model = GainCurve(names, mean[columns], np.maximum(std[columns], CONSTANT), config.hidden)
    with torch.no_grad():
        # Start where the first guess is of the right size: the middle of the prices, one e-fold per fragment.
        last = model.layers[-1]
        if isinstance(last, torch.nn.Linear):
            last.bias[0] = float(np.mean([np.mean(view.price_range) for view in views]))
            last.bias[1] = 0.5
    return model


@contextmanager
def _deterministic(threads: int) -> Iterator[None]:
    before = torch.get_num_threads(), torch.get_deterministic_debug_mode()
    torch.set_num_threads(threads)
    # Not use_deterministic_algorithms: it imports torch's compiler, see trainer.adam.
    torch.set_deterministic_debug_mode("error")
    # Regrets far below 1 make subnormal gradients, with which a step takes up to 20 times as long on x86.
    torch.set_flush_denormal(True)
    try:
        yield
    finally:
        torch.set_flush_denormal(False)
        torch.set_num_threads(before[0])
        torch.set_deterministic_debug_mode(before[1])
