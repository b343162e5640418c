"""Proof that the forms of a network agree: torch, ONNX in onnxruntime, GLSL on this machine's GL driver."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import moderngl
import numpy as np
import torch
from numpy.typing import NDArray

from renderer.context import describe
from renderer.features import FEATURES
from renderer.onnx_network import OnnxNetwork
from schemas.bundle import (
    GLSL,
    GLSL_HALF,
    ONNX,
    UBO,
    UBO_DATA,
    UBO_HALF,
    UBO_HALF_DATA,
    ParityReport,
)
from trainer.glsl_network import CHUNK, glsl_outputs, refused
from trainer.half import half_outputs
from trainer.models import Network
from trainer.weights import Weights

TOLERANCE: Final = 1e-5
"""Largest difference of a form in float32, relative to max(1, |value|)."""

_NOT_FINITE: Final = 1e30
"""The difference of an output that is no number: JSON has none for that."""


def check(
    weights: Weights, folder: Path, features: NDArray[np.float32], ctx: moderngl.Context, tolerance: float = TOLERANCE
) -> ParityReport:
    """Compare the forms on real inputs.

    Args:
        weights: The network, for torch.
        folder: Where the forms are; those in float16 may be missing.
        features: float32 [R, C], columns `renderer.features.FEATURES`; all rows are compared.
        ctx: The GL context.
        tolerance: Largest difference allowed, relative to max(1, |value|).

    Raises:
        Problem: There are no rows, a value is not finite, GLSL does not compile, or a form differs.
    """
    if features.ndim != 2 or features.shape[1] != len(FEATURES) or not len(features):
        raise refused(f"features have the shape {features.shape}, not [rows, {len(FEATURES)}]")
    if not np.isfinite(features).all():
        raise refused("a feature is not finite")
    inputs = np.ascontiguousarray(features[:, weights.columns])
    truth = torch_outputs(weights, inputs)
    if not np.isfinite(truth).all():
        raise refused("the network's output is not finite")

    def on_gl(file: str, data: str | None = None) -> NDArray[np.float32]:
        return glsl_outputs(folder / file, inputs, ctx, len(weights.outputs), folder / data if data else None)

    halves = (folder / GLSL_HALF).is_file()
    report = ParityReport(
        count=len(inputs),
        tolerance=tolerance,
        torch_onnx=_difference(truth, OnnxNetwork(folder / ONNX).run(inputs), "onnxruntime"),
        torch_glsl=_difference(truth, on_gl(GLSL), "GLSL"),
        torch_ubo=_difference(truth, on_gl(UBO, UBO_DATA), UBO),
        half={
            name: _difference(truth, on_gl(name, data), name)
            for name, data in ((GLSL_HALF, None), (UBO_HALF, UBO_HALF_DATA))
            if halves
        },
        float16=_float16(weights, inputs, truth) if halves else None,
        driver=describe(ctx),
    )
    if report.worst > tolerance:
        raise refused(
            f"the forms differ by {report.torch_onnx:.2g} (ONNX), {report.torch_glsl:.2g} (GLSL) and "
            f"{report.torch_ubo:.2g} (GLSL with a buffer, both on {report.driver}) from torch, more than {tolerance:g}"
        )
    return report


def _float16(weights: Weights, inputs: NDArray[np.float32], truth: NDArray[np.float32]) -> float:
    """Difference of hidden layers in float16, relative to the scale of each output."""
    scale = np.maximum(np.abs(truth).max(axis=0), 1.0)
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is found by its difference
        worst = (np.abs(half_outputs(weights, inputs) - truth) / scale).max()
    return float(worst) if np.isfinite(worst) else _NOT_FINITE


def torch_outputs(weights: Weights, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
    """float32 [R, outputs] of torch; inputs float32 [R, F] in the order of the weights' features.

    Args:
        weights: The network.
        inputs: float32 [R, F], features, not normalised, R >= 1.
    """
    model = Network.from_weights(weights)
    parts = []
    with torch.no_grad():
        for start in range(0, len(inputs), CHUNK):
            parts.append(model(torch.from_numpy(inputs[start : start + CHUNK])).numpy())
    return np.concatenate(parts)


def _difference(truth: NDArray[np.float32], other: NDArray[np.float32], form: str) -> float:
    if not np.isfinite(other).all():
        raise refused(f"the output of {form} is not finite")
    return float((np.abs(other.astype(np.float64) - truth) / np.maximum(1.0, np.abs(truth))).max())
