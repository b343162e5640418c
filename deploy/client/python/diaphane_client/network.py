"""A bundle's network in numpy: `weights.safetensors`, normalisation, dense layers with ReLU, activations.

docs/BUNDLE.md has the formulas; arithmetic is float32, as in the shaders.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from diaphane_client.manifest import Manifest

FEATURE_LIMIT: Final = np.float32(4.0)
"""Normalised features are clamped to this, either way."""
MAX_HEADER_BYTES: Final = 1 << 20

_CHUNK: Final = 1 << 14
"""Rows at a time: their hidden layers stay in the cache."""

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Network:
    """Weights, and what is done with them.

    Attributes:
        mean: float32 [C], subtracted from the inputs.
        std: float32 [C], what they are divided by after that.
        layers: Weight float32 [out, in] and bias float32 [out] of each layer.
        outputs: What is answered, in this order.
    """

    mean: Array
    std: Array
    layers: tuple[tuple[Array, Array], ...]
    outputs: tuple[str, ...]

    def answer(self, features: NDArray[np.floating]) -> Array:
        """What the network answers.

        Args:
            features: [P, C], not normalised; finite.

        Returns:
            float32 [P, outputs].
        """
        answers = np.empty((len(features), len(self.outputs)), dtype=np.float32)
        for start in range(0, len(features), _CHUNK):
            part = slice(start, start + _CHUNK)
            with np.errstate(over="ignore", invalid="ignore"):  # finite weights can overflow
                answers[part] = self._answer(features[part].astype(np.float32))
        return answers

    def _answer(self, features: Array) -> Array:
        x = np.clip((features - self.mean) / self.std, -FEATURE_LIMIT, FEATURE_LIMIT)
        for weight, bias in self.layers[:-1]:
            x = np.maximum(x @ weight.T + bias, np.float32(0.0))
        weight, bias = self.layers[-1]
        raw = x @ weight.T + bias
        for i, name in enumerate(self.outputs):
            if name in _ACTIVATIONS:
                raw[:, i] = _ACTIVATIONS[name](raw[:, i])
        return np.asarray(raw, dtype=np.float32)


def read_network(content: bytes, manifest: Manifest) -> Network:
    """The network of a weights file.

    Args:
        content: `weights.safetensors`.
        manifest: Of the same bundle.

    Raises:
        ValueError: The tensors are not those of the manifest, finite float32.
    """
    tensors = _tensors(content, manifest.layers)
    count = len(manifest.hidden) + 1
    return Network(
        mean=np.array([feature.mean for feature in manifest.features], dtype=np.float32),
        std=np.array([feature.std for feature in manifest.features], dtype=np.float32),
        layers=tuple((tensors[f"layer{i}.weight"], tensors[f"layer{i}.bias"]) for i in range(count)),
        outputs=manifest.outputs,
    )


def _tensors(content: bytes, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Array]:
    """Tensors of a safetensors file: 8 bytes with the header's length, the header as JSON, then the numbers."""
    length = int.from_bytes(content[:8], "little")
    if not 0 < length <= min(MAX_HEADER_BYTES, len(content) - 8):
        raise ValueError("the weights have no header")
    data = content[8 + length :]
    try:
        header = json.loads(content[8 : 8 + length])
        header.pop("__metadata__", None)
        if header.keys() != shapes.keys():
            raise ValueError("the weights do not hold the tensors of the manifest")
        return {name: _tensor(name, header[name], shape, data) for name, shape in shapes.items()}
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("the header of the weights is not valid") from error


def _tensor(name: str, entry: Mapping[str, Any], shape: tuple[int, ...], data: bytes) -> Array:
    first, end = entry["data_offsets"]
    size = 4 * int(np.prod(shape))
    if (
        entry["dtype"] != "F32"
        or tuple(entry["shape"]) != shape
        or not 0 <= first <= end <= len(data)
        or end - first != size
    ):
        raise ValueError(f"{name} is not float32 {list(shape)}")
    tensor = np.frombuffer(data[first:end], dtype="<f4").astype(np.float32).reshape(shape)
    if not np.isfinite(tensor).all():
        raise ValueError(f"{name} is not finite")
    return tensor


def _softplus(x: Array) -> Array:
    return np.asarray(np.maximum(x, 0.0) + np.log1p(np.exp(-np.abs(x))), dtype=np.float32)


def _sigmoid(x: Array) -> Array:
    small = np.exp(-np.abs(x))
    return np.asarray(np.where(x < 0.0, small, 1.0) / (1.0 + small), dtype=np.float32)


_ACTIVATIONS: Final[Mapping[str, Callable[[Array], Array]]] = {"prior": _softplus, "importance": _sigmoid}
"""Output -> function of the last layer's number, without overflow; of the others it is the number itself."""
