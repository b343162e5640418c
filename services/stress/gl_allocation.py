"""The compute passes that allot slots against their twin in numpy, which `services.stress.fills` judges."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.allocation.gpu import BLOCK, GpuAllocation
from renderer.allocation.lattice import Curves, curves_of, solve_on_lattice
from renderer.programs import Programs
from services.stress.allocations import edge_budgets
from services.stress.fills import gain_cases, overflow_cases
from services.stress.findings import Finding, Options, compared
from services.stress.gl_bounds import bound_of

PATH = "allocation"


def rows(ctx: moderngl.Context, options: Options, driver: str) -> Iterator[Finding]:
    """All kinds of gain curves at every edge budget; each search begins where the one before it ended.

    Args:
        ctx: The context.
        options: The seed; quick runs have fewer pixels.
        driver: For the paths.
    """
    rng = np.random.default_rng(options.seed)
    pixels = BLOCK + 100 if options.quick else 20 * BLOCK + 100
    n = np.where(rng.random(pixels) < 0.02, 4096, rng.integers(0, 7, pixels)).astype(np.int32)
    bound, programs, allocation = bound_of(PATH, deep=False), Programs(ctx), GpuAllocation(ctx)
    for name, (a, b) in (gain_cases(rng, pixels) | overflow_cases(rng, pixels)).items():
        curves = curves_of(a, b)
        for budget in edge_budgets(n):
            found = _allotted(ctx, programs, allocation, curves, n, budget)
            truth = solve_on_lattice(curves, n, budget).k.astype(np.float64)
            path = f"{PATH} · {driver}"
            row = compared(path, "gain curves", found, truth, bound.value, bound.measure, bound.floor)
            yield replace(row, where=f"{name}, F {budget}, {row.where}")


def _allotted(
    ctx: moderngl.Context,
    programs: Programs,
    allocation: GpuAllocation,
    curves: Curves,
    n: NDArray[np.int32],
    budget: int,
) -> NDArray[np.float64]:
    counts = ctx.buffer(n.astype(np.uint32))
    frame = allocation.select(programs, counts, len(n), budget)
    frame.solve(ctx.buffer(np.stack([curves.a, curves.rate], axis=1)))
    return np.diff(np.frombuffer(frame.place().read(), dtype=np.uint32).astype(np.float64))
