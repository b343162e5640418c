"""What a preset brings to the one training loop: network, loss of a step, optimiser, learning rate, score."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Protocol

import numpy as np
import torch
from torch import Tensor

from renderer.features import FEATURES
from schemas.bundle import gain_outputs
from schemas.problem import Problem
from schemas.tail import TAILS, TailName
from trainer.adam import Adam
from trainer.config import Preset, TrainConfig
from trainer.dataset import Batch, Drawing, ViewData, normalisation, sample_batch
from trainer.evaluate import BudgetScore, evaluate
from trainer.loss import lagrangian_regret, rising_prices
from trainer.models import Network
from trainer.paper import LABEL_PEAK, PAPER_FEATURES, Fill, paper_batch, paper_inputs, unscored
from trainer.sgd import Optimiser, Sgd
from trainer.views import View
from trainer.weights import Weights

CONSTANT: Final = 1e-4
"""A feature that spreads less than this over the training data says nothing: the model does not read it."""

PRINTED_L1: Final = 0.3
PRINTED_L2: Final = 0.35
"""DHOIT's L1 on the first hidden layer's weights, L2 on the second's."""

RELEASED: Final = 0.01
"""L1 and L2 of the code that its authors released: on the hidden layers' biases alone."""


class Head(Protocol):
    """What differs between presets."""

    def network(self, views: Sequence[View], config: TrainConfig) -> Network:
        """A new network, its weights drawn by the seed."""

    def optimiser(self, network: Network) -> Optimiser:
        """What takes the steps."""

    def rate(self, config: TrainConfig, step: int) -> float:
        """Learning rate of a step."""

    def loss(
        self, network: Network, views: Sequence[ViewData], config: TrainConfig, step: int, drawing: Drawing
    ) -> Tensor:
        """Loss of this process's rows of a step's batch, a scalar, times their share of the batch."""

    def scores(self, weights: Weights, views: Sequence[ViewData]) -> list[BudgetScore]:
        """How near its allocations come to the optimum."""


class BinGainsHead:
    """The gain of every depth bin, by Lagrangian regret and Adam (METHOD.md section 4)."""

    def network(self, views: Sequence[View], config: TrainConfig) -> Network:
        """See `Head`."""
        mean, std = normalisation([view.asset for view in views], [view.moments() for view in views])
        names = [name for name in FEATURES if name in config.features and std[FEATURES.index(name)] > CONSTANT]
        names = names or [FEATURES[0]]
        columns = [FEATURES.index(name) for name in names]
        torch.manual_seed(config.seed)
        outputs = gain_outputs(TAILS[_tail_of(views)].bins)
        spread = np.maximum(std[columns], CONSTANT)
        network = Network(names, mean[columns], spread, config.hidden, "bin-gains", outputs)
        with torch.no_grad():
            # Start where the first guess is of the right size: the middle of the prices.
            network.dense[-1].bias[:-1] = float(np.mean([np.mean(view.price_range) for view in views]))
        return network

    def optimiser(self, network: Network) -> Optimiser:
        """See `Head`."""
        return Adam(network.parameters())

    def rate(self, config: TrainConfig, step: int) -> float:
        """See `Head`."""
        return 0.5 * config.lr * (1.0 + math.cos(math.pi * step / config.steps))

    def loss(
        self, network: Network, views: Sequence[ViewData], config: TrainConfig, step: int, drawing: Drawing
    ) -> Tensor:
        """See `Head`."""
        columns = [FEATURES.index(name) for name in network.features]
        if config.feature_noise:
            drawing = replace(drawing, noise=np.float32(config.feature_noise) * network.std.numpy())
        batch = sample_batch(views, columns, (config.seed, step), config.batch, drawing)
        return batch.share * batch_loss(network, batch, config)

    def scores(self, weights: Weights, views: Sequence[ViewData]) -> list[BudgetScore]:
        """See `Head`."""
        return evaluate(weights, views)


class PaperHead:
    """DHOIT's importance: mean squared error on `K / F` at a constant rate (docs/TRAINING.md).

    Args:
        is_repaired: Whether the network can learn: inputs of one size, labels within reach of a sigmoid, Adam, the
            released code's regularisation, and a fill that uses the budget; else SGD and Eq. 3, as printed.
    """

    def __init__(self, is_repaired: bool) -> None:
        self.is_repaired = is_repaired
        self.fill: Fill = "budget" if is_repaired else "paper"

    def network(self, views: Sequence[View], config: TrainConfig) -> Network:
        """See `Head`."""
        count = len(PAPER_FEATURES)
        mean, std = np.zeros(count, np.float32), np.ones(count, np.float32)
        if self.is_repaired:
            # The rows of a view are in memory while it is its turn.
            seen = [_paper_moments(view.subset(config.validation_rows, config.seed)) for view in views]
            scored = [(view.asset, found) for view, found in zip(views, seen, strict=True) if found is not None]
            if not scored:
                raise unscored()
            mean, std = normalisation([asset for asset, _ in scored], [found for _, found in scored])
            # The shares of one pixel are near 1e-6: whatever spreads at all is read.
            std = np.where(std > 0.0, std, np.float32(1.0)).astype(np.float32)
        torch.manual_seed(config.seed)
        return Network(PAPER_FEATURES, mean, std, config.hidden, "importance", ("importance",))

    def optimiser(self, network: Network) -> Optimiser:
        """See `Head`."""
        return Adam(network.parameters()) if self.is_repaired else Sgd(network.parameters())

    def rate(self, config: TrainConfig, step: int) -> float:
        """See `Head`."""
        return config.lr

    def loss(
        self, network: Network, views: Sequence[ViewData], config: TrainConfig, step: int, drawing: Drawing
    ) -> Tensor:
        """See `Head`."""
        inputs, counts, budgets, share = paper_batch(views, (config.seed, step), config.batch, drawing)
        label = torch.from_numpy(counts) / torch.from_numpy(budgets[:, 0])
        if self.is_repaired:
            label = torch.clamp(label * torch.from_numpy(budgets[:, 1]) / LABEL_PEAK, max=1.0)
        squared = torch.square(network(torch.from_numpy(inputs))[:, 0] - label).mean()
        return share * (squared + self._penalty(network))

    def scores(self, weights: Weights, views: Sequence[ViewData]) -> list[BudgetScore]:
        """See `Head`."""
        return evaluate(weights, views, self.fill)

    def _penalty(self, network: Network) -> Tensor:
        one, two, *_ = network.dense
        if self.is_repaired:
            return RELEASED * (one.bias.abs().sum() + torch.square(two.bias).sum())
        return PRINTED_L1 * one.weight.abs().sum() + PRINTED_L2 * torch.square(two.weight).sum()


HEADS: Final[dict[Preset, Head]] = {
    "bin-gains": BinGainsHead(),
    "paper": PaperHead(is_repaired=False),
    "paper-repaired": PaperHead(is_repaired=True),
}


def batch_loss(network: Network, batch: Batch, config: TrainConfig) -> Tensor:
    """Loss of a batch, a scalar.

    Rows: `mean log(1 + r)`. Views: the error of an allocation is the sum of its rows', dominated by few of them;
    `log(1 + mean r / mean (E* / lambda))` is the logarithm of a view's Lagrangian over its optimum's, which is what
    is scored.
    """
    features, counts, slopes, prior, log_lambda, scale = (
        torch.from_numpy(array)
        for array in (batch.features, batch.counts, batch.slopes, batch.prior, batch.log_lambda, batch.scale)
    )
    answers = network(features)
    prices = rising_prices(answers[:, :-1] + answers[:, -1:] * prior, counts)
    regret, astray = lagrangian_regret(prices, counts, slopes, log_lambda)
    rows = torch.log1p(regret).mean()
    views = torch.log1p(regret.view(len(scale), -1).mean(dim=1) / scale).mean()
    leak = torch.log1p(astray).mean()
    return (1.0 - config.view_weight) * rows + config.view_weight * views + config.leak * leak


def _tail_of(views: Sequence[View]) -> TailName:
    """The tail of all views.

    Raises:
        Problem: They have several.
    """
    tails = sorted({view.tail for view in views})
    if len(tails) > 1:
        raise Problem(
            f"The training views have the tails {', '.join(tails)}: a network is trained for one.",
            "Label all scenes with one tail.",
        )
    return tails[0]


def _paper_moments(view: ViewData) -> tuple[np.ndarray, np.ndarray] | None:
    """Means of the inputs and of their squares, over the budgets that the view is scored at; None without any.

    A budget has no price where less than it suffices: such a view has no labels, and no row of it is drawn.
    """
    budgets = view.paper.budgets if view.paper is not None else (0,)
    if not budgets:
        return None
    inputs = np.concatenate([paper_inputs(view, slice(None), budget) for budget in budgets])
    return inputs.mean(axis=0, dtype=np.float64), np.square(inputs, dtype=np.float64).mean(axis=0)
