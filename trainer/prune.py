"""What a network has but does not use is dropped, exactly: inputs that nothing reads, units that are never heard."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from schemas.bundle import FEATURE_LIMIT
from trainer.weights import Layer, Weights

_ROUNDING: Final = 1e-4
"""A sum counts as never positive if it stays this share of its terms below 0: no rounding of float32 lifts it."""


def pruned(weights: Weights) -> Weights:
    """The same network without its unused parts; the answers are the same for every input.

    A hidden unit goes if its ReLU is 0 for all inputs in the box that normalisation clamps to (by interval
    arithmetic), or if no unit after it reads it; an input goes if no unit reads it. At least one of each stays.
    """
    kept, layers = np.arange(len(weights.features)), list(weights.layers)
    before = -1
    while (size := sum(weight.size for weight, _ in layers)) != before:
        before = size
        layers = _without_units(layers)
        read = _used(layers[0][0])
        layers[0] = (layers[0][0][:, read], layers[0][1])
        kept = kept[read]
    return replace(
        weights,
        features=tuple(weights.features[i] for i in kept),
        mean=weights.mean[kept],
        std=weights.std[kept],
        layers=tuple((np.ascontiguousarray(weight), np.ascontiguousarray(bias)) for weight, bias in layers),
    )


def _without_units(layers: list[Layer]) -> list[Layer]:
    """The layers without hidden units that are silent or unread."""
    made = list(layers)
    low = np.full(layers[0][0].shape[1], -FEATURE_LIMIT)
    high = -low
    for i in range(len(made) - 1):
        weight, bias = (array.astype(np.float64) for array in made[i])
        up, down = np.maximum(weight, 0.0), np.minimum(weight, 0.0)
        most, least = up @ high + down @ low + bias, up @ low + down @ high + bias
        terms = np.abs(weight) @ np.maximum(np.abs(low), np.abs(high)) + np.abs(bias)
        silent = most <= -_ROUNDING * terms
        keep = np.flatnonzero(~silent & np.isin(np.arange(len(bias)), _used(made[i + 1][0])))
        if len(keep) == 0:
            keep = np.zeros(1, dtype=np.int64)
        made[i] = (made[i][0][keep], made[i][1][keep])
        made[i + 1] = (made[i + 1][0][:, keep], made[i + 1][1])
        low, high = np.maximum(least[keep], 0.0), np.maximum(most[keep], 0.0)
    return made


def _used(weight: NDArray[np.float32]) -> NDArray[np.int64]:
    """Columns that are not all zero; the first where all are."""
    used = np.flatnonzero(weight.any(axis=0))
    return used if len(used) else np.zeros(1, dtype=np.int64)
