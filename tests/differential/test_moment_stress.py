"""The shader's arithmetic of `moment` on lists that no scene has, float32 against the float64 twin."""

from __future__ import annotations

from collections.abc import Callable

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray
from support.dumps import dump_of

from renderer.programs import source
from renderer.reference import moment as twin
from renderer.techniques.moment import BIAS, OVERESTIMATION
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump
from schemas.tail import MAX_EXPONENT

LISTS = 40
"""Random lists of each kind."""

# One invocation sums a list in its order, as blending does, and composites it.
_MAIN = """
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Offsets { uint offset[]; };
layout(std430, binding = 3) readonly buffer Fragments { vec4 fragment[]; };  // linear RGB, alpha
layout(std430, binding = 4) readonly buffer Depths { float depth[]; };
layout(std430, binding = 5) writeonly buffer Means { vec4 mean[]; };

void main() {
    int p = int(gl_GlobalInvocationID.x);
    float total = 0.0;
    vec4 moments = vec4(0.0);
    for (uint i = offset[p]; i < offset[p + 1]; ++i) {
        float absorbance = optical_depth(fragment[i].a);
        float x = warped_depth(p, depth[i]);
        float x2 = x * x;
        total += absorbance;
        moments += absorbance * vec4(x, x2, x2 * x, x2 * x2);
    }
    Distribution d = distribution_of(moments / total);
    vec4 sum = vec4(0.0);
    for (uint i = offset[p]; i < offset[p + 1]; ++i) {
        float weight = fragment[i].a * visibility(d, total, warped_depth(p, depth[i]));
        sum += vec4(weight * fragment[i].rgb, weight);
    }
    mean[p] = vec4(sum.rgb / sum.a, total);
}
"""

Depths = Callable[[np.random.Generator, int], NDArray[np.float64]]


def _clusters(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Two groups of nearly equal depths far from each other."""
    return np.where(rng.random(n) < 0.5, 1.0, 30.0) * (1.0 + 1e-6 * rng.random(n))


KINDS: dict[str, Depths] = {
    "spread": lambda rng, n: rng.uniform(1.0, 10.0, n),
    "equal": lambda rng, n: np.full(n, rng.uniform(1e-3, 1e3)),
    "ties": lambda rng, n: rng.integers(1, 4, n).astype(np.float64),
    "ratio of 1e7": lambda rng, n: 10.0 ** rng.uniform(-3.0, 4.0, n),
    "close": lambda rng, n: 7.0 + 1e-5 * rng.random(n),
    "clusters": _clusters,
    "tiny": lambda rng, n: 1e-30 * rng.uniform(1.0, 2.0, n),
    "one far behind": lambda rng, n: np.where(np.arange(n) == 0, 1e4, rng.uniform(1.0, 1.1, n)),
}


def lists(kind: str, n: int, alpha: int | None, seed: int) -> FragmentDump:
    rng = np.random.default_rng(seed)
    pixels = []
    for _ in range(LISTS if n < 1000 else 4):
        rgba = rng.integers(0, 256, (n, 4)).astype(np.uint8)
        rgba[:, 3] = rng.integers(1, 255, n) if alpha is None else alpha
        pixels.append((rgba, KINDS[kind](rng, n).astype(np.float32)))
    return dump_of(pixels)


def composited(ctx: moderngl.Context, dump: FragmentDump) -> NDArray[np.float64]:
    """The GLSL's means with the exact total transmittance, float64 [P, 3]."""
    header = f"#version 450\n#define MOMENT_BIAS {BIAS}\n#define OVERESTIMATION {OVERESTIMATION}\n"
    text = [header, f"#define MAX_EXPONENT {MAX_EXPONENT}\n", source("common/log1p.glsl")]
    text += [source("moment/warp.glsl").replace('#include "common/log1p.glsl"', ""), source("moment/reconstruct.glsl")]
    shader = ctx.compute_shader("".join([*text, _MAIN]))
    runs = [slice(a, b) for a, b in zip(dump.offsets[:-1], dump.offsets[1:], strict=True)]
    fragments = np.concatenate([decode_gamma2(dump.rgba[:, :3]), dump.rgba[:, 3:] / 255.0], axis=1)
    buffers = [
        ctx.buffer(dump.offsets.astype(np.uint32)),
        ctx.buffer(np.array([dump.depth[run].min() for run in runs])),
        ctx.buffer(np.array([dump.depth[run].max() for run in runs])),
        ctx.buffer(fragments.astype(np.float32)),
        ctx.buffer(dump.depth),
        ctx.buffer(reserve=16 * dump.pixels),
    ]
    for binding, buffer in enumerate(buffers):
        buffer.bind_to_storage_buffer(binding)
    shader.run(dump.pixels)
    ctx.memory_barrier()
    read = np.frombuffer(buffers[-1].read(), dtype=np.float32).reshape(-1, 4).astype(np.float64)
    through = np.exp(-read[:, 3:])
    return (1.0 - through) * read[:, :3] + through * decode_gamma2(dump.background)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 20, 300, 4096])
@pytest.mark.parametrize("kind", KINDS)
def test_float32_stays_near_float64(ctx: moderngl.Context, kind: str, n: int) -> None:
    for alpha in (1, 128, 254, None):
        dump = lists(kind, n, alpha, seed=n)
        found, expected = composited(ctx, dump), twin.picture(dump)
        error = np.abs(found - expected)
        assert np.isfinite(found).all()
        if kind == "one far behind":
            # The spread of the near group is less than the bias and the rounding of the moments: they do not say which
            # of it is in front. What remains is an average of its colours.
            assert error.mean() < 5e-2
            assert found.min() > -1e-6
            assert found.max() < 1.0 + 1e-6
        else:
            assert error.max() < 1e-4
