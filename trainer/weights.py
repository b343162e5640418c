"""A gain-curve network as plain arrays: what every exported form is made from, and inference in numpy."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import safe_open
from safetensors.numpy import save_file

from renderer.features import FEATURES
from schemas.bundle import FEATURE_LIMIT, GAIN_FLOOR

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Weight float32 [out, in] and bias float32 [out]."""

_CHUNK = 1 << 14
"""Rows at a time: their hidden layers stay in the cache."""


@dataclass(frozen=True)
class Weights:
    """A gain-curve network.

    Attributes:
        features: Names of its inputs, members of `renderer.features.FEATURES`.
        mean: float32 [F], subtracted from the inputs.
        std: float32 [F], > 0, what the inputs are divided by after that.
        layers: Dense layers, ReLU between them; the last gives (a, softplus^-1(b - GAIN_FLOOR)).
    """

    features: tuple[str, ...]
    mean: NDArray[np.float32]
    std: NDArray[np.float32]
    layers: tuple[Layer, ...]

    @property
    def columns(self) -> list[int]:
        """Where the inputs are in the columns of `renderer.features.derive`."""
        return [FEATURES.index(name) for name in self.features]

    @property
    def hidden(self) -> tuple[int, ...]:
        """Units of each hidden layer."""
        return tuple(len(bias) for _, bias in self.layers[:-1])

    def digest(self) -> str:
        """Hex sha256 over everything that decides what the network answers."""
        hasher = hashlib.sha256(json.dumps(self.features).encode())
        for array in (self.mean, self.std, *(array for layer in self.layers for array in layer)):
            hasher.update(np.ascontiguousarray(array).tobytes())
        return hasher.hexdigest()

    def predict(self, features: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Gain curves of pixels.

        Args:
            features: float32 [R, 26], columns `renderer.features.FEATURES`.

        Returns:
            a and b, float32 [R] each: the log gain of core fragment k is `a - b (k - 1)`, b >= GAIN_FLOOR.
        """
        a, b = (np.empty(len(features), dtype=np.float32) for _ in range(2))
        for start in range(0, len(features), _CHUNK):
            part = slice(start, start + _CHUNK)
            x = np.clip((features[part, self.columns] - self.mean) / self.std, -FEATURE_LIMIT, FEATURE_LIMIT)
            for weight, bias in self.layers[:-1]:
                x = np.maximum(x @ weight.T + bias, np.float32(0.0))
            weight, bias = self.layers[-1]
            out = x @ weight.T + bias
            # softplus, without overflow
            a[part] = out[:, 0]
            b[part] = np.maximum(out[:, 1], 0.0) + np.log1p(np.exp(-np.abs(out[:, 1]))) + np.float32(GAIN_FLOOR)
        return a, b


def save_weights(path: Path, weights: Weights) -> None:
    """Write a network to a safetensors file; the names of its features are in the metadata."""
    tensors = {"mean": weights.mean, "std": weights.std}
    for index, (weight, bias) in enumerate(weights.layers):
        tensors |= {
            f"layer{index}.weight": np.ascontiguousarray(weight),
            f"layer{index}.bias": np.ascontiguousarray(bias),
        }
    save_file(tensors, path, metadata={"features": json.dumps(weights.features)})


def load_weights(path: Path) -> Weights:
    """Read what `save_weights` wrote."""
    with safe_open(path, framework="numpy") as file:
        features = tuple(json.loads(file.metadata()["features"]))
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no dict
    count = sum(name.endswith(".bias") for name in tensors)
    layers = tuple((tensors[f"layer{index}.weight"], tensors[f"layer{index}.bias"]) for index in range(count))
    return Weights(features, tensors["mean"], tensors["std"], layers)
