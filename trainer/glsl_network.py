"""A network's GLSL form on rows of features, in a compute shader on this machine's GL driver."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from schemas.problem import ExitCode, Problem

CHUNK: Final = 1 << 17
"""Rows at a time: 26 features of that many are 14 MB."""

_GROUP: Final = 64

_MAIN: Final = f"""
layout(local_size_x = {_GROUP}) in;
layout(std430, binding = 0) readonly buffer Inputs {{ float inputs[]; }};
layout(std430, binding = 1) writeonly buffer Outputs {{ float outputs[]; }};
uniform uint rows;

void main() {{
    uint row = gl_GlobalInvocationID.x;
    if (row >= rows) return;
    float x[DIAPHANE_FEATURES];
    for (int i = 0; i < DIAPHANE_FEATURES; ++i) x[i] = inputs[row * uint(DIAPHANE_FEATURES) + uint(i)];
    DiaphaneAnswer found = diaphane_predict(x);
    for (int i = 0; i < DIAPHANE_OUTPUTS; ++i) outputs[row * uint(DIAPHANE_OUTPUTS) + uint(i)] = found.y[i];
}}
"""


def glsl_outputs(
    path: Path, inputs: NDArray[np.float32], ctx: moderngl.Context, outputs: int, data: Path | None = None
) -> NDArray[np.float32]:
    """What a GLSL file answers.

    Args:
        path: A bundle's `predict.glsl`, or another of its GLSL files.
        inputs: float32 [R, F] in the order of its features.
        ctx: The GL context.
        outputs: How many numbers it answers.
        data: What its uniform block holds; None where it has none.

    Returns:
        float32 [R, outputs].

    Raises:
        Problem: The driver does not compile it.
    """
    try:
        shader = ctx.compute_shader(f"#version 450\n{path.read_text()}{_MAIN}")
    except moderngl.Error as reason:
        raise refused(f"{path.name} does not compile: {reason}") from reason
    source = ctx.buffer(reserve=min(CHUNK, len(inputs)) * inputs.shape[1] * 4)
    target = ctx.buffer(reserve=min(CHUNK, len(inputs)) * 4 * outputs)
    block = ctx.buffer(data.read_bytes() if data else bytes(16))
    parts = []
    try:
        block.bind_to_uniform_block(0)
        for start in range(0, len(inputs), CHUNK):
            chunk = inputs[start : start + CHUNK]
            source.write(chunk.tobytes())
            source.bind_to_storage_buffer(0)
            target.bind_to_storage_buffer(1)
            shader["rows"] = len(chunk)
            shader.run(-(-len(chunk) // _GROUP))
            ctx.memory_barrier()
            parts.append(np.frombuffer(target.read(len(chunk) * 4 * outputs), dtype=np.float32).reshape(-1, outputs))
    finally:
        for resource in (source, target, block, shader):
            resource.release()
    return np.concatenate(parts)


def refused(why: str) -> Problem:
    """A bundle whose forms do not agree, or of which one does not work."""
    return Problem(
        f"The bundle is not written: {why}.",
        "Train again, with another seed if it stays so; if only GLSL differs, update the GL driver.",
        ExitCode.CHECK_FAILED,
    )
