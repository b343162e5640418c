"""Networks in torch, for training and as one side of the parity check."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from schemas.bundle import ACTIVATIONS, FEATURE_LIMIT, HeadName, OutputName
from trainer.weights import Weights

_FUNCTIONS: Final = {"identity": lambda x: x, "softplus": nn.functional.softplus, "sigmoid": torch.sigmoid}
"""Those of `ACTIVATIONS`."""


def activate(outputs: Sequence[OutputName], raw: Tensor) -> Tensor:
    """A network's answer, float32 [R, outputs], from what its last layer gives, of the same shape."""
    return torch.stack([_FUNCTIONS[ACTIVATIONS[name]](raw[:, i]) for i, name in enumerate(outputs)], dim=1)


class Network(nn.Module):
    """Normalise, dense layers with ReLU, and the outputs of a head (`schemas.bundle.ACTIVATIONS`).

    Args:
        features: Names of the inputs.
        mean: float32 [F], mean of the inputs.
        std: float32 [F], spread of the inputs, > 0.
        hidden: Units of the hidden layers.
        head: How the outputs are read.
        outputs: What is answered, in this order.
    """

    mean: Tensor
    std: Tensor

    def __init__(
        self,
        features: Sequence[str],
        mean: NDArray[np.float32],
        std: NDArray[np.float32],
        hidden: Sequence[int],
        head: HeadName,
        outputs: Sequence[OutputName],
    ) -> None:
        super().__init__()
        self.features, self.head, self.outputs = tuple(features), head, tuple(outputs)
        self.register_buffer("mean", torch.from_numpy(mean.astype(np.float32)))
        self.register_buffer("std", torch.from_numpy(std.astype(np.float32)))
        sizes = (len(self.features), *hidden, len(self.outputs))
        self.layers = nn.ModuleList(nn.Linear(sizes[i], sizes[i + 1]) for i in range(len(sizes) - 1))

    def forward(self, x: Tensor) -> Tensor:
        """What the network answers.

        Args:
            x: float32 [R, F], the features named in `features`.

        Returns:
            float32 [R, outputs].
        """
        x = torch.clamp((x - self.mean) / self.std, -FEATURE_LIMIT, FEATURE_LIMIT)
        for layer in self.layers[:-1]:
            x = torch.relu(layer(x))
        return activate(self.outputs, self.layers[-1](x))

    @property
    def dense(self) -> list[nn.Linear]:
        """The layers, from the inputs to the outputs."""
        return [layer for layer in self.layers if isinstance(layer, nn.Linear)]

    def weights(self) -> Weights:
        """A copy of the weights as plain arrays."""
        layers = tuple(
            (layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy()) for layer in self.dense
        )
        return Weights(
            self.features, self.mean.numpy().copy(), self.std.numpy().copy(), layers, self.head, self.outputs
        )

    @classmethod
    def from_weights(cls, weights: Weights) -> Network:
        """The network with the given weights."""
        network = cls(weights.features, weights.mean, weights.std, weights.hidden, weights.head, weights.outputs)
        with torch.no_grad():
            for layer, (weight, bias) in zip(network.dense, weights.layers, strict=True):
                layer.weight.copy_(torch.from_numpy(weight))
                layer.bias.copy_(torch.from_numpy(bias))
        return network
