"""The shader's arithmetic of `moment` on lists that no scene has, float32 against the float64 twin."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from evaluation.stress.cases import dump_of
from evaluation.stress.findings import Bound, Finding, Options, compared
from evaluation.stress.gl_bounds import BOUNDS
from renderer.programs import source
from renderer.reference import moment as twin
from renderer.techniques.moment import BIAS, OVERESTIMATION
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump
from schemas.tail import MAX_EXPONENT

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

ONE_FAR: Final = "one far behind"
"""The kind that four moments cannot describe."""

KINDS: Final[dict[str, Depths]] = {
    "spread": lambda rng, n: rng.uniform(1.0, 10.0, n),
    "equal": lambda rng, n: np.full(n, rng.uniform(1e-3, 1e3)),
    "ties": lambda rng, n: rng.integers(1, 4, n).astype(np.float64),
    "ratio of 1e7": lambda rng, n: 10.0 ** rng.uniform(-3.0, 4.0, n),
    "close": lambda rng, n: 7.0 + 1e-5 * rng.random(n),
    "clusters": lambda rng, n: np.where(rng.random(n) < 0.5, 1.0, 30.0) * (1.0 + 1e-6 * rng.random(n)),
    "tiny": lambda rng, n: 1e-30 * rng.uniform(1.0, 2.0, n),
    ONE_FAR: lambda rng, n: np.where(np.arange(n) == 0, 1e4, rng.uniform(1.0, 1.1, n)),
}
"""Depths of a list, metres, by what is hard about them."""

DELICATE: Final = (3, 4)
"""Lengths of lists that four moments describe just so, or hardly."""

_LENGTHS, _QUICK_LENGTHS = (1, 2, 3, 5, 20, 300, 4096), (2, 3, 5, 20, 300)


def lists(kind: str, n: int, alpha: int | None, seed: int, count: int = 40) -> FragmentDump:
    """Random lists of n fragments of one kind, one a pixel; `alpha` stored, None: any."""
    rng = np.random.default_rng(seed)
    pixels = []
    for _ in range(count if n < 1000 else 4):
        rgba = rng.integers(0, 256, (n, 4)).astype(np.uint8)
        rgba[:, 3] = rng.integers(1, 255, n) if alpha is None else alpha
        pixels.append((rgba, KINDS[kind](rng, n).astype(np.float32)))
    return dump_of(pixels, (255, 255, 255))


def program(ctx: moderngl.Context) -> moderngl.ComputeShader:
    """The harness around the technique's own files."""
    header = f"#version 450\n#define MOMENT_BIAS {BIAS}\n#define OVERESTIMATION {OVERESTIMATION}\n"
    text = [header, f"#define MAX_EXPONENT {MAX_EXPONENT}\n", source("common/log1p.glsl")]
    text += [source("moment/warp.glsl").replace('#include "common/log1p.glsl"', ""), source("moment/reconstruct.glsl")]
    return ctx.compute_shader("".join([*text, _MAIN]))


def composited(ctx: moderngl.Context, shader: moderngl.ComputeShader, dump: FragmentDump) -> NDArray[np.float64]:
    """The GLSL's means with the exact total transmittance, float64 [P, 3]."""
    fragments = np.concatenate([decode_gamma2(dump.rgba[:, :3]), dump.rgba[:, 3:] / 255.0], axis=1)
    buffers = [
        ctx.buffer(dump.offsets.astype(np.uint32)),
        ctx.buffer(dump.depth[dump.offsets[:-1]]),
        ctx.buffer(dump.depth[dump.offsets[1:] - 1]),
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


def bound_of(kind: str, n: int) -> tuple[str, Bound]:
    """The case that lists of a kind and length belong to, and its bound."""
    if n in DELICATE and kind != ONE_FAR:
        return "3 fragments", BOUNDS["moment.arithmetic, 3 fragments"]
    return f"depths: {kind}", BOUNDS.get(f"moment.arithmetic, {kind}", BOUNDS["moment.arithmetic"])


def rows(ctx: moderngl.Context, options: Options, driver: str) -> Iterator[Finding]:
    """Every kind of list, of all lengths and opacities; a row of the table is made of what comes for its case."""
    shader = program(ctx)
    for kind in KINDS:
        for n in _QUICK_LENGTHS if options.quick else _LENGTHS:
            case, bound = bound_of(kind, n)
            for alpha in (1, 128, 254, None):
                dump = lists(kind, n, alpha, options.seed + n, 10 if options.quick else 40)
                found, truth = composited(ctx, shader, dump), twin.picture(dump)
                path = f"moment.arithmetic · {driver}"
                row = compared(path, case, found, truth, bound.value, bound.measure, bound.floor)
                name = "any" if alpha is None else f"{alpha}/255"
                yield replace(row, where=f"{kind}, n {n}, alpha {name}, {row.where}")
