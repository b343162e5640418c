"""The gain-curve network in torch, for training and as one side of the parity check."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from schemas.bundle import FEATURE_LIMIT, GAIN_FLOOR
from trainer.weights import Weights


class GainCurve(nn.Module):
    """Normalise, dense layers with ReLU, two outputs: `a` (log gain of the first fragment) and `b` (its fall).

    Args:
        features: Names of the inputs.
        mean: float32 [F], mean of the inputs.
        std: float32 [F], spread of the inputs, > 0.
        hidden: Units of the hidden layers.
    """

    mean: Tensor
    std: Tensor

    def __init__(
        self,
        features: Sequence[str],
        mean: NDArray[np.float32],
        std: NDArray[np.float32],
        hidden: Sequence[int] = (32, 16),
    ) -> None:
        super().__init__()
        self.features = tuple(features)
        self.register_buffer("mean", torch.from_numpy(mean.astype(np.float32)))
        self.register_buffer("std", torch.from_numpy(std.astype(np.float32)))
        sizes = (len(self.features), *hidden, 2)
        self.layers = nn.ModuleList(nn.Linear(sizes[i], sizes[i + 1]) for i in range(len(sizes) - 1))

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Gain curves of pixels.

        Args:
            x: float32 [R, F], the features named in `features`.

        Returns:
            a, b: float32 [R]; b >= GAIN_FLOOR.
        """
        x = torch.clamp((x - self.mean) / self.std, -FEATURE_LIMIT, FEATURE_LIMIT)
        for layer in self.layers[:-1]:
            x = torch.relu(layer(x))
        out = self.layers[-1](x)
        return out[:, 0], nn.functional.softplus(out[:, 1]) + GAIN_FLOOR

    def weights(self) -> Weights:
        """A copy of the weights as plain arrays."""
        layers = [
            (layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy())
            for layer in self.layers
            if isinstance(layer, nn.Linear)
        ]
        return Weights(self.features, self.mean.numpy().copy(), self.std.numpy().copy(), tuple(layers))

    @classmethod
    def from_weights(cls, weights: Weights) -> GainCurve:
        """The network with the given weights."""
        model = cls(weights.features, weights.mean, weights.std, weights.hidden)
        with torch.no_grad():
            for layer, (weight, bias) in zip(model.layers, weights.layers, strict=True):
                if isinstance(layer, nn.Linear):
                    layer.weight.copy_(torch.from_numpy(weight))
                    layer.bias.copy_(torch.from_numpy(bias))
        return model
