"""Every file of a bundle that a renderer compiles or runs, by its name."""

from __future__ import annotations

from schemas.bundle import (
    GLSL,
    GLSL_HALF,
    HLSL,
    ONNX,
    UBO,
    UBO_DATA,
    UBO_HALF,
    UBO_HALF_DATA,
    WGSL,
    WGSL_HALF,
)
from trainer import dialects
from trainer.export_onnx import onnx_model
from trainer.export_shader import half_source, shader_source
from trainer.export_ubo import ubo_data, ubo_source
from trainer.weights import Weights


def float_forms(weights: Weights) -> dict[str, bytes]:
    """The files in float32.

    Raises:
        ValueError: A weight is not finite.
    """
    return {
        ONNX: onnx_model(weights),
        GLSL: shader_source(weights).encode(),
        UBO: ubo_source(weights).encode(),
        UBO_DATA: ubo_data(weights),
        WGSL: shader_source(weights, dialects.WGSL).encode(),
        HLSL: shader_source(weights, dialects.HLSL).encode(),
    }


def half_forms(weights: Weights) -> dict[str, bytes]:
    """The files in float16.

    Raises:
        ValueError: A weight is not finite, or too large for float16.
    """
    return {
        GLSL_HALF: half_source(weights).encode(),
        UBO_HALF: ubo_source(weights, half=True).encode(),
        UBO_HALF_DATA: ubo_data(weights, half=True),
        WGSL_HALF: half_source(weights, dialects.WGSL).encode(),
    }
