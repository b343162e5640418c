"""The algorithm of the float16 forms in numpy, every product and every sum rounded to float16."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.bundle import FEATURE_LIMIT
from trainer.weights import Weights, activate

_CHUNK = 1 << 13
"""Rows at a time: a layer of them stays in the cache."""


def half_outputs(weights: Weights, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
    """What `trainer.export_shader.half_source` computes where float16 is the type of its hidden layers.

    Inputs are normalised in float32; the last layer is float32. A driver may keep more bits in between, so this is
    the least exact that the forms can be.

    Args:
        weights: The network; no weight too large for float16.
        inputs: float32 [R, F] in the order of its features.

    Returns:
        float32 [R, outputs].
    """
    return np.concatenate([_rows(weights, inputs[i : i + _CHUNK]) for i in range(0, len(inputs), _CHUNK)])


def _rows(weights: Weights, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
    x = np.clip((inputs - weights.mean) / weights.std, -FEATURE_LIMIT, FEATURE_LIMIT).T.astype(np.float16)
    for weight, bias in weights.layers[:-1]:
        total = np.repeat(bias.astype(np.float16)[:, None], x.shape[1], axis=1)
        for column, row in zip(weight.T.astype(np.float16), x, strict=True):
            total += column[:, None] * row
        x = np.maximum(total, np.float16(0.0))
    weight, bias = weights.layers[-1]
    return activate(weights.outputs, x.T.astype(np.float32) @ weight.T + bias)
