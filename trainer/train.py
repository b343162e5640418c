"""The training loop of every preset: deterministic by seed, resumable, the best state on validation views is kept.

Rules:
- the same data, settings and number of threads give the same weights, interrupted or not, and whether rows are read
  from shards or are in memory;
- processes that train together (`trainer.team`) draw the same batch, take their share of its groups and add up their
  gradients: the result is that of one process but for the rounding of that sum;
- the assets that decide when to stop are kept out of the training assets. Those that results are reported on have no
  say in anything.
"""

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

from schemas.problem import Problem
from trainer.checkpoint import Checkpoint, Step, data_key, load_checkpoint, save_checkpoint
from trainer.config import TrainConfig
from trainer.dataset import GROUP, Drawing
from trainer.evaluate import BudgetScore, geometric_mean
from trainer.heads import HEADS
from trainer.log import TrainLog
from trainer.models import Network
from trainer.sgd import Optimiser
from trainer.team import Alone, Team
from trainer.views import Pool, View
from trainer.weights import Weights

__all__ = ["REPORT_EVERY", "Progress", "TrainConfig", "TrainResult", "train"]

Progress = Callable[[int, int, float, float], None]
"""Called with (step, steps, loss, latest validation score: geometric mean of error / optimum, NaN before the first)."""

REPORT_EVERY: Final = 50
"""Steps between two calls of the progress callback and lines of the log; every validation adds one."""

LEAST_VALIDATION_ROWS: Final = 1000
"""Rows of each validation view that are scored, however many views there are."""

MINING_ROWS: Final = 2000
"""Rows of each training view that its hardness is measured on."""


@dataclass(frozen=True)
class TrainResult:
    """The best state of a training and how it got there.

    Attributes:
        weights: The weights with the best score.
        score: Their geometric mean of error / optimum on the validation views.
        history: One entry per validation; fewer steps than asked for where it stopped early.
        kept_out: Training assets that were not trained on, so that they could decide when to stop.
    """

    weights: Weights
    score: float
    history: tuple[Step, ...]
    kept_out: tuple[str, ...] = ()


def train(
    views: Sequence[View],
    held_out: Sequence[View],
    config: TrainConfig,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    start: Weights | None = None,
    replay: Sequence[View] = (),
    log: Path | None = None,
    team: Team | None = None,
) -> TrainResult:
    """Train a network.

    Args:
        views: Training data.
        held_out: Views of other assets, by which the best state is chosen and the training stopped; without any,
            some of the training assets are kept out for that if `config.patience` asks for it, and the training
            views have to do otherwise.
        config: Everything else.
        progress: Told how it goes.
        checkpoint: File to write the state to from time to time, and to continue from if it belongs to the same
            data and configuration.
        start: Network to begin with, with its features and their normalisation; None: weights drawn by the seed.
        replay: Views of an earlier data set, mixed in so that what `start` knows of them is not forgotten.
        log: File of JSON lines (`trainer.log`) that is written meanwhile.
        team: The processes that train together; None: this one alone.

    Returns:
        The best state. The same for the same data, configuration and number of threads, interrupted or not.

    Raises:
        Problem: The network of `start` is not one of the preset, or a batch has fewer groups than the team members.
    """
    _check(config, start, team or Alone())
    kept_out: tuple[str, ...] = ()
    if config.patience and not held_out:
        # Of new and of replayed assets alike: neither are to be forgotten.
        kept_out = tuple(
            asset
            for given in (views, replay)
            for asset in stopping_assets([view.asset for view in given], config.folds, config.seed)
        )
        held_out = [view for view in (*views, *replay) if view.asset in kept_out]
        views, replay = ([view for view in given if view.asset not in kept_out] for given in (views, replay))
    with _deterministic(config.threads):
        run = _Run(views, held_out, replay, config, start, checkpoint, team or Alone())
        lines = TrainLog(log if run.team.rank == 0 else None, run.state.step, config.batch)
        while run.state.step < config.steps and not run.state.is_stale(config.patience):
            loss, lr = run.advance()
            step = run.state.step
            score = None
            if step % config.validate_every == 0 or step == config.steps:
                score = run.validate(loss)
            if score is not None or step % REPORT_EVERY == 0:
                lines.write(step, loss, score, lr)
                if progress is not None:
                    progress(step, config.steps, loss, run.state.history[-1].score if run.state.history else math.nan)
            run.save()
        run.save(at_once=True)
        run.network.load_state_dict(run.state.best)
        return TrainResult(run.network.weights(), run.state.best_score, tuple(run.state.history), kept_out)


def stopping_assets(assets: Sequence[str], folds: int, seed: int) -> tuple[str, ...]:
    """The training assets that decide when to stop: one of `folds`, drawn by the seed, none of fewer than three.

    Args:
        assets: Of the training views, with repetitions.
        folds: One of how many.
        seed: Of the training.
    """
    names = sorted(set(assets))
    if len(names) < 3:
        return ()
    order = np.random.default_rng((seed, len(names))).permutation(len(names))
    return tuple(sorted(names[i] for i in order[: max(1, len(names) // folds)]))


class _Run:
    """A training under way."""

    def __init__(
        self,
        views: Sequence[View],
        held_out: Sequence[View],
        replay: Sequence[View],
        config: TrainConfig,
        start: Weights | None,
        checkpoint: Path | None,
        team: Team,
    ) -> None:
        self.config, self.team, self._checkpoint = config, team, checkpoint
        self.head = HEADS[config.preset]
        self.network = self.head.network(views, config) if start is None else Network.from_weights(start)
        self.optimiser: Optimiser = self.head.optimiser(self.network)
        room = config.pool_rows // (2 if replay else 1)
        self._pools = [Pool(given, room, config.pool_steps, config.seed) for given in (views, replay)]
        judges = [*(held_out or views), *([] if held_out else replay)]
        rows = min(config.validation_rows, max(LEAST_VALIDATION_ROWS, config.pool_rows // len(judges)))
        # The first process validates for all.
        self._validation = [view.subset(rows, config.seed) for view in judges] if team.rank == 0 else []
        if config.preset != "bin-gains" and self._validation and not any(len(x.anchors) for x in self._validation):
            raise Problem(
                "No validation view is scored at a budget, so nothing tells which state is best.",
                "Hold out a view of more fragments than its budgets.",
            )
        self._mined = [view.subset(MINING_ROWS, config.seed) for view in views] if config.mining else []
        began = config.decisive + ("" if start is None else start.digest())
        self._key = data_key(began, [*views, *held_out, *replay])
        self.state = Checkpoint.fresh(self.network)
        if checkpoint is not None:
            self.state = load_checkpoint(checkpoint, self._key, self.network, self.optimiser) or self.state
        if team.agreed(self.state.step) != self.state.step:
            raise Problem(
                "The processes of this training do not see the same checkpoint.",
                "Put it where all of them can read it, or delete it.",
            )
        self._saved = time.monotonic()

    def advance(self) -> tuple[float, float]:
        """Takes a step; its loss and learning rate."""
        config, step = self.config, self.state.step
        drawn, replayed = (pool.at(step) for pool in self._pools)
        hardness = [self.state.hardness[number] for number, _ in drawn] if self.state.hardness else []
        drawing = Drawing(
            replay=[view for _, view in replayed],
            replay_share=config.replay_share,
            hardness=hardness,
            mining=config.mining,
            rank=self.team.rank,
            size=self.team.size,
        )
        loss = self.head.loss(self.network, [view for _, view in drawn], config, step, drawing)
        self.optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        total = loss.detach()
        self.team.add(
            [total, *(parameter.grad for parameter in self.network.parameters() if parameter.grad is not None)]
        )
        lr = self.head.rate(config, step)
        self.optimiser.step(lr)
        self.state.step += 1
        return float(total), lr

    def validate(self, loss: float) -> float:
        """Notes where the training stands; the score on the validation views."""
        weights = self.network.weights()
        score = geometric_mean(self.head.scores(weights, self._validation)) if self._validation else math.nan
        score = self.team.agreed(score)
        self.state.record(self.network, loss, score)
        self.state.hardness = [_hardness(self.head.scores(weights, [view])) for view in self._mined]
        return score

    def save(self, *, at_once: bool = False) -> None:
        """Writes a checkpoint if it is time."""
        if self._checkpoint is None or self.team.rank:
            return
        if at_once or time.monotonic() - self._saved > self.config.checkpoint_seconds:
            save_checkpoint(self._checkpoint, self._key, self.state, self.network, self.optimiser)
            self._saved = time.monotonic()


def _check(config: TrainConfig, start: Weights | None, team: Team) -> None:
    expected = "bin-gains" if config.preset == "bin-gains" else "importance"
    if start is not None and start.head != expected:
        raise Problem(
            f"A network with the head {start.head} cannot be trained as {config.preset}.",
            "Begin with a network of the same preset, or from scratch.",
        )
    if config.batch // GROUP < team.size:
        raise Problem(
            f"A batch of {config.batch} rows has {config.batch // GROUP} groups for {team.size} processes.",
            "Train with fewer processes, or with a larger batch.",
        )


def _hardness(scores: Sequence[BudgetScore]) -> float:
    """How far a view is from its optimum: 0 where nothing is left to learn."""
    return max(0.0, math.log(geometric_mean(scores))) if scores else 0.0


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
