"""The GLSL form of the features against the numba form, on the GL driver."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray
from support.dumps import random_dump

from renderer.features import FEATURES, TEXELS, derive, features_glsl, gather
from schemas.tail import DEFAULT_TAIL

_MAIN = """
layout(local_size_x = 64) in;
layout(std430, binding = 0) readonly buffer Sums { vec4 sums[]; };
layout(std430, binding = 1) writeonly buffer Out { float result[]; };
uniform uint rows;
void main() {
    uint row = gl_GlobalInvocationID.x;
    if (row >= rows) return;
    vec4 s[TEXELS];
    for (int i = 0; i < TEXELS; ++i) s[i] = sums[row * uint(TEXELS) + uint(i)];
    float x[DIAPHANE_FEATURES];
    diaphane_features(s, x);
    for (int i = 0; i < DIAPHANE_FEATURES; ++i) result[row * uint(DIAPHANE_FEATURES) + uint(i)] = x[i];
}
"""


def run(ctx: moderngl.Context, names: tuple[str, ...], sums: NDArray[np.float32]) -> NDArray[np.float32]:
    shader = ctx.compute_shader(f"#version 450\n#define TEXELS {TEXELS}\n" + features_glsl(names) + _MAIN)
    source, target = ctx.buffer(sums.tobytes()), ctx.buffer(reserve=4 * len(sums) * len(names))
    source.bind_to_storage_buffer(0)
    target.bind_to_storage_buffer(1)
    shader["rows"] = len(sums)
    shader.run(-(-len(sums) // 64))
    ctx.memory_barrier()
    return np.frombuffer(target.read(), np.float32).reshape(len(sums), len(names))


@pytest.mark.parametrize("max_n", [2, 40])
def test_glsl_features_are_the_numba_ones(ctx: moderngl.Context, max_n: int) -> None:
    sums = gather(random_dump(200, 150, max_n, seed=max_n), "binned-16")
    on_gpu, on_cpu = run(ctx, FEATURES, sums), derive(sums)
    spread = ["_std" in name for name in FEATURES]
    # A spread is the root of a difference of nearly equal numbers: one rounding of its square, 1e-7, is 3e-4 of it.
    assert np.abs(on_gpu[:, spread] ** 2 - on_cpu[:, spread] ** 2).max() < 1e-6
    rest = np.logical_not(spread)
    np.testing.assert_allclose(on_gpu[:, rest], on_cpu[:, rest], rtol=2e-6, atol=2e-6)


def test_a_subset_is_in_the_order_asked_for(ctx: moderngl.Context) -> None:
    sums = gather(random_dump(64, 64, 9, seed=5), DEFAULT_TAIL)
    names = ("depth_extent", "background_b", "log_n", "front_7", "mean_4")
    columns = [FEATURES.index(name) for name in names]
    np.testing.assert_allclose(run(ctx, names, sums), derive(sums)[:, columns], rtol=2e-6, atol=2e-6)
