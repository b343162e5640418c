"""Rows of a manifest with which anyone can check what their compiler made of a bundle's shader."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from renderer.features import derive, gather
from schemas.bundle import HALF_FILES, ONNX, SHADERS, SelfTest
from schemas.fragments import FragmentDump
from trainer.weights import Weights

ROWS: Final = 16
PIXELS: Final = 8

FLOAT_TOLERANCE: Final = 1e-4
"""Ten times what parity allows: a GPU's own exp, log and division pass, another order of the weights does not."""

HALF_TOLERANCE: Final = 1e-2
"""What parity allows where hidden layers are computed in float16."""

FEATURE_TOLERANCE: Final = 1e-4


def self_test(weights: Weights, features: NDArray[np.float32], files: Collection[str]) -> SelfTest:
    """Rows spread over real inputs with the answers to them, and pixels with their features.

    Args:
        weights: The network of the bundle.
        features: float32 [R, C], real inputs, columns `renderer.features.FEATURES`.
        files: The bundle's files.
    """
    double = replace(
        weights,
        mean=weights.mean.astype(np.float64),
        std=weights.std.astype(np.float64),
        layers=tuple((weight.astype(np.float64), bias.astype(np.float64)) for weight, bias in weights.layers),
    )
    chosen = features[np.linspace(0, len(features) - 1, ROWS).astype(np.int64)]
    sums = pixel_sums()
    scale = np.maximum(np.abs(weights.run(features)).max(axis=0), 1.0)
    return SelfTest(
        features=_rows(chosen[:, weights.columns]),
        outputs=_rows(double.run(chosen)),
        sums=_rows(sums),
        derived=_rows(derive(sums)[:, weights.columns]),
        tolerance={
            name: HALF_TOLERANCE if name in HALF_FILES else FLOAT_TOLERANCE
            for name in (ONNX, *SHADERS)
            if name in files
        },
        feature_tolerance=FEATURE_TOLERANCE,
        output_scale=tuple(float(value) for value in scale),
    )


def pixel_sums() -> NDArray[np.float32]:
    """float32 [PIXELS, 4 * texels], columns `renderer.features.SUMS`: of 1, 4, 7, ... fragments drawn at random."""
    rng = np.random.default_rng(6)
    counts = 1 + 3 * np.arange(PIXELS)
    total = int(counts.sum())
    pixel = np.repeat(np.arange(PIXELS), counts)
    depth = rng.uniform(1.0, 30.0, total).astype(np.float32)
    dump = FragmentDump(
        width=PIXELS,
        height=1,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        rgba=rng.integers(1, 255, (total, 4), dtype=np.uint8),
        depth=depth[np.lexsort((depth, pixel))],
        background=rng.integers(0, 256, (PIXELS, 3), dtype=np.uint8),
        facing=np.zeros(PIXELS, dtype=np.uint8),
    )
    return gather(dump, "binned-16")


def _rows(values: NDArray[np.float32]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(value) for value in row) for row in values)
