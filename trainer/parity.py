"""Proof that the three forms of a network agree: torch, ONNX in onnxruntime, GLSL on this machine's GL driver."""

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
from schemas.bundle import GLSL, ONNX, ParityReport
from trainer.glsl_network import CHUNK, glsl_outputs, refused
from trainer.models import GainCurve
from trainer.weights import Weights

TOLERANCE: Final = 1e-5
"""Largest difference, relative to max(1, |value|)."""


def check(
    weights: Weights, folder: Path, features: NDArray[np.float32], ctx: moderngl.Context, tolerance: float = TOLERANCE
) -> ParityReport:
    """Compare the forms on real inputs.

    Args:
        weights: The network, for torch.
        folder: Where `model.onnx` and `predict.glsl` are.
        features: float32 [R, 26], columns `renderer.features.FEATURES`; all rows are compared.
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
    report = ParityReport(
        count=len(inputs),
        tolerance=tolerance,
        torch_onnx=_difference(truth, OnnxNetwork(folder / ONNX).run(inputs), "onnxruntime"),
        torch_glsl=_difference(truth, glsl_outputs(folder / GLSL, inputs, ctx), "GLSL"),
        driver=describe(ctx),
    )
    if max(report.torch_onnx, report.torch_glsl) > tolerance:
        raise refused(
            f"the forms differ by {report.torch_onnx:.2g} (ONNX) and {report.torch_glsl:.2g} (GLSL on {report.driver}) "
            f"from torch, more than {tolerance:g}"
        )
    return report


def torch_outputs(weights: Weights, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
    """float32 [R, 2] of torch; inputs float32 [R, F] in the order of the weights' features."""
    model = GainCurve.from_weights(weights)
    parts = []
    with torch.no_grad():
        for start in range(0, len(inputs), CHUNK):
            a, b = model(torch.from_numpy(inputs[start : start + CHUNK]))
            parts.append(torch.stack([a, b], dim=1).numpy())
    return np.concatenate(parts)


def _difference(truth: NDArray[np.float32], other: NDArray[np.float32], form: str) -> float:
    if not np.isfinite(other).all():
        raise refused(f"the output of {form} is not finite")
    return float((np.abs(other.astype(np.float64) - truth) / np.maximum(1.0, np.abs(truth))).max())
