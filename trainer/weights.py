"""A network as plain arrays: what every exported form is made from, and inference in numpy."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from safetensors import safe_open
from safetensors.numpy import save_file

from renderer.features import FEATURES
from schemas.bundle import ACTIVATIONS, FEATURE_LIMIT, HeadName, OutputName

Layer = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Weight float32 [out, in] and bias float32 [out]."""

_CHUNK = 1 << 14
"""Rows at a time: their hidden layers stay in the cache."""


@dataclass(frozen=True)
class Weights:
    """A network.

    Attributes:
        features: Names of its inputs, members of `renderer.features.FEATURES`.
        mean: float32 [F], subtracted from the inputs.
        std: float32 [F], > 0, what the inputs are divided by after that.
        layers: Dense layers, ReLU between them; `schemas.bundle.ACTIVATIONS` makes the outputs of the last.
        head: How the outputs are read.
        outputs: What the network answers, in this order; one of `schemas.bundle.HEADS[head]`.
    """

    features: tuple[str, ...]
    mean: NDArray[np.float32]
    std: NDArray[np.float32]
    layers: tuple[Layer, ...]
    head: HeadName
    outputs: tuple[OutputName, ...]

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
        hasher = hashlib.sha256(json.dumps([self.features, self.head, self.outputs]).encode())
        for array in (self.mean, self.std, *(array for layer in self.layers for array in layer)):
            hasher.update(np.ascontiguousarray(array).tobytes())
        return hasher.hexdigest()

    def run(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """What the network answers.

        Args:
            features: float32 [R, C], columns `renderer.features.FEATURES`.

        Returns:
            float32 [R, outputs].
        """
        return self.answer(features, self.columns)

    def answer(self, inputs: NDArray[np.float32], columns: Sequence[int] | None = None) -> NDArray[np.float32]:
        """What the network answers to inputs of its own.

        Args:
            inputs: float32 [R, C].
            columns: Where the inputs named in `features` are in it, in that order; None: they are its columns.

        Returns:
            float32 [R, outputs].
        """
        read = slice(None) if columns is None else list(columns)
        answers = np.empty((len(inputs), len(self.outputs)), dtype=np.float32)
        for start in range(0, len(inputs), _CHUNK):
            part = slice(start, start + _CHUNK)
            x = np.clip((inputs[part, read] - self.mean) / self.std, -FEATURE_LIMIT, FEATURE_LIMIT)
            for weight, bias in self.layers[:-1]:
                x = np.maximum(x @ weight.T + bias, np.float32(0.0))
            weight, bias = self.layers[-1]
            answers[part] = activate(self.outputs, x @ weight.T + bias)
        return answers


def activate(outputs: Sequence[OutputName], raw: NDArray[np.float32]) -> NDArray[np.float32]:
    """A network's answer, float32 [R, outputs], from what its last layer gives, of the same shape.

    Args:
        outputs: Name of each column, in order.
        raw: float32 [R, outputs], values of the last layer.
    """
    return np.stack([_FUNCTIONS[ACTIVATIONS[name]](raw[:, i]) for i, name in enumerate(outputs)], axis=1)


def _softplus(x: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(np.maximum(x, 0.0) + np.log1p(np.exp(-np.abs(x))), dtype=np.float32)


def _sigmoid(x: NDArray[np.float32]) -> NDArray[np.float32]:
    small = np.exp(-np.abs(x))
    return np.asarray(np.where(x < 0.0, small, 1.0) / (1.0 + small), dtype=np.float32)


_FUNCTIONS: Final = {"identity": lambda x: x, "softplus": _softplus, "sigmoid": _sigmoid}
"""Those of `ACTIVATIONS`, without overflow."""


def save_weights(path: Path, weights: Weights) -> None:
    """Write a network to a safetensors file; names of its features, head and outputs are in the metadata."""
    tensors = {"mean": weights.mean, "std": weights.std}
    for index, (weight, bias) in enumerate(weights.layers):
        tensors |= {
            f"layer{index}.weight": np.ascontiguousarray(weight),
            f"layer{index}.bias": np.ascontiguousarray(bias),
        }
    names = {"features": json.dumps(weights.features), "head": weights.head, "outputs": json.dumps(weights.outputs)}
    save_file(tensors, path, metadata=names)


def load_weights(path: Path) -> Weights:
    """Read what `save_weights` wrote."""
    with safe_open(path, framework="numpy") as file:
        names = file.metadata()
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - it is no dict
    features, outputs = (tuple(json.loads(names[key])) for key in ("features", "outputs"))
    count = sum(name.endswith(".bias") for name in tensors)
    layers = tuple((tensors[f"layer{index}.weight"], tensors[f"layer{index}.bias"]) for index in range(count))
    return Weights(features, tensors["mean"], tensors["std"], layers, names["head"], outputs)
