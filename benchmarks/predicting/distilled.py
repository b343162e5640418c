"""Distillation, tried: a network learns what a larger one, trained on the same views, answers (Hinton et al. 2015)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from renderer.features import FEATURES
from trainer.config import TrainConfig
from trainer.dataset import Batch, Drawing, ViewData, sample_batch
from trainer.heads import GainCurveHead, batch_loss
from trainer.models import Network
from trainer.weights import Weights

BLUNT: Final = 1.0
"""Differences of log gains above this count linearly, those below squared."""


class DistilledHead(GainCurveHead):
    """A `gain-curve` head whose loss is, in part, how far the gains are from a teacher's.

    Prices are drawn as for the regret. Gains are compared at the fragment where the teacher stops at the row's price:
    over the prices that are those that budgets decide about, and between the count's clamps the teacher's log gain
    there is the log price.

    Args:
        teacher: The larger network; its head is `gain-curve`.
        share: Of the loss that is the teacher's, 0..1; the rest is that of `trainer.heads.batch_loss`.
    """

    def __init__(self, teacher: Weights, share: float) -> None:
        self.teacher, self.share = teacher, share

    def loss(
        self, network: Network, views: Sequence[ViewData], config: TrainConfig, step: int, drawing: Drawing
    ) -> Tensor:
        """See `trainer.heads.Head`. `config.feature_noise` is ignored."""
        own = [FEATURES.index(name) for name in network.features]
        both = sample_batch(views, own + self.teacher.columns, (config.seed, step), config.batch, drawing)
        batch = replace(both, features=both.features[:, : len(own)])
        k, gains = taught_gains(self.teacher, batch, both.features[:, len(own) :])
        a, b = network(torch.from_numpy(batch.features)).unbind(dim=1)
        answered = a - b * torch.from_numpy(k - np.float32(1.0))
        wrong = torch.nn.functional.smooth_l1_loss(answered, torch.from_numpy(gains), beta=BLUNT)
        regret = batch_loss(network, batch, config) if self.share < 1.0 else torch.zeros(())
        return batch.share * (self.share * wrong + (1.0 - self.share) * regret)


def taught_gains(
    teacher: Weights, batch: Batch, inputs: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where a teacher stops at the rows' prices, and its log gains there.

    Args:
        teacher: The network.
        batch: The rows.
        inputs: float32 [B, F], what the teacher reads of them.

    Returns:
        k float32 [B], `clamp(1 + (a - log lambda) / b, 0, n)`, and `a - b (k - 1)`, float32 [B].
    """
    a, b = np.ascontiguousarray(teacher.answer(inputs).T)
    k = np.clip(np.float32(1.0) + (a - batch.log_lambda) / b, 0, batch.n)
    return k, a - b * (k - np.float32(1.0))
