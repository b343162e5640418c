"""The compute passes that allot slots against their twin in numpy: the same to the bit, on every driver."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from renderer.allocation.fill import solve_lambda
from renderer.allocation.gpu import BLOCK, STATE, FrameAllocation, GpuAllocation, SolvedState
from renderer.allocation.lattice import LAST, MOST_FRAGMENTS, Curves, curves_of, solve_on_lattice
from renderer.programs import Programs
from services.stress.allocations import edge_budgets
from services.stress.fills import gain_cases, overflow_cases


@dataclass
class Bench:
    """Runs the passes on arrays."""

    ctx: moderngl.Context
    programs: Programs

    def begin(self, allocation: GpuAllocation, n: NDArray[np.integer], budget: int) -> FrameAllocation:
        counts = self.ctx.buffer(n.astype(np.uint32))
        return allocation.select(self.programs, counts, len(n), budget)

    def solve(
        self, allocation: GpuAllocation, curves: Curves, n: NDArray[np.integer], budget: int
    ) -> tuple[NDArray[np.int64], SolvedState]:
        frame = self.begin(allocation, n, budget)
        frame.solve(self.ctx.buffer(np.stack([curves.a, curves.rate], axis=1)))
        offsets = np.frombuffer(frame.place().read(), dtype=np.uint32)
        assert len(offsets) == len(n) + 1
        assert offsets[0] == 0
        return np.diff(offsets.astype(np.int64)).astype(np.int64), frame.read_state()


@pytest.fixture(scope="module")
def bench(gl: moderngl.Context) -> Bench:
    return Bench(gl, Programs(gl))


def usual(rng: np.random.Generator, pixels: int) -> tuple[NDArray[np.int64], Curves]:
    n = np.where(rng.random(pixels) < 0.02, 4096, rng.integers(0, 7, pixels))
    return n, curves_of(rng.normal(-8.0, 3.0, pixels), rng.uniform(0.02, 2.0, pixels))


@pytest.mark.parametrize("pixels", [1, 63, 127, BLOCK - 1, BLOCK, BLOCK + 1, 9 * BLOCK + 777])
def test_counts_equal_the_twins_for_every_size(bench: Bench, ctx: moderngl.Context, pixels: int) -> None:
    rng = np.random.default_rng(pixels)
    n, curves = usual(rng, pixels)
    allocation = GpuAllocation(ctx)
    for budget in {*edge_budgets(n.astype(np.int32)), 0, 1, int(n.sum()), 2 * int(n.sum())}:
        k, state = bench.solve(allocation, curves, n, budget)
        expected = solve_on_lattice(curves, n, budget)
        assert np.array_equal(k, expected.k)
        assert k.sum() == min(budget, n.sum())
        assert state.complete == (expected.index is None)
        assert state.complete or state.index == expected.index


def every_case(rng: np.random.Generator, pixels: int) -> dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]]:
    return gain_cases(rng, pixels) | overflow_cases(rng, pixels)


@pytest.mark.parametrize("name", list(every_case(np.random.default_rng(0), 1)))
def test_curves_of_all_kinds_give_the_twins_counts(bench: Bench, ctx: moderngl.Context, name: str) -> None:
    rng = np.random.default_rng(5)
    pixels = 3000
    n, _ = usual(rng, pixels)
    curves = curves_of(*every_case(rng, pixels)[name])
    for budget in edge_budgets(n.astype(np.int32)):
        k, _ = bench.solve(GpuAllocation(ctx), curves, n, budget)
        assert np.array_equal(k, solve_on_lattice(curves, n, budget).k)


def test_counts_are_those_of_float64_but_for_a_few_ties(bench: Bench, ctx: moderngl.Context) -> None:
    rng = np.random.default_rng(3)
    pixels = 50_000
    n = rng.integers(0, 30, pixels)
    a, b = rng.normal(-8.0, 3.0, pixels).astype(np.float32), rng.uniform(0.05, 2.0, pixels).astype(np.float32)
    for share in (0.1, 0.4, 0.8):
        budget = int(share * n.sum())
        k, _ = bench.solve(GpuAllocation(ctx), curves_of(a, b), n, budget)
        expected, _ = solve_lambda(a, b, n, budget)
        assert np.abs(k - expected).max() <= 1
        assert (k != expected).mean() < 1e-3


def test_a_warm_start_needs_two_rounds_and_changes_nothing(bench: Bench, ctx: moderngl.Context) -> None:
    rng = np.random.default_rng(7)
    n, curves = usual(rng, 20_000)
    budget = int(n.sum()) // 3
    allocation = GpuAllocation(ctx)
    k, cold = bench.solve(allocation, curves, n, budget)
    assert cold.rounds == 4
    for drift in (0.0, 0.02, -0.02):
        moved = Curves(curves.a + np.float32(drift), curves.rate)
        again, warm = bench.solve(allocation, moved, n, budget)
        assert warm.rounds == 2
        assert np.array_equal(again, solve_on_lattice(moved, n, budget).k)
    again, _ = bench.solve(allocation, curves, n, budget)
    assert np.array_equal(again, k)


@pytest.mark.parametrize("shift", [-1e20, -500.0, -3.0, 3.0, 500.0, 1e20])
def test_a_warm_start_that_misses_still_meets_the_budget(bench: Bench, ctx: moderngl.Context, shift: float) -> None:
    rng = np.random.default_rng(9)
    n, curves = rng.integers(0, 30, 5000), usual(rng, 5000)[1]
    budget = int(n.sum()) // 4
    allocation = GpuAllocation(ctx)
    bench.solve(allocation, curves, n, budget)
    elsewhere = Curves(curves.a + np.float32(shift), curves.rate)
    k, state = bench.solve(allocation, elsewhere, n, budget)
    expected = solve_on_lattice(elsewhere, n, budget)
    assert np.array_equal(k, expected.k)
    assert k.sum() == budget
    assert state.index == expected.index
    assert 3 <= state.rounds <= 5


def test_sums_beyond_32_bits_do_not_wrap(bench: Bench, ctx: moderngl.Context) -> None:
    pixels = 80_000
    n = np.full(pixels, MOST_FRAGMENTS + 10_000)
    assert pixels * MOST_FRAGMENTS > 2**32
    curves = curves_of(np.random.default_rng(1).normal(-8.0, 3.0, pixels), np.full(pixels, 0.02))
    for budget in (pixels, 3_000_000, 2**31 - 2):
        k, _ = bench.solve(GpuAllocation(ctx), curves, n, budget)
        assert k.sum() == budget
        assert np.array_equal(k, solve_on_lattice(curves, n, budget).k)


def test_the_list_holds_the_occupied_pixels_once(bench: Bench, ctx: moderngl.Context) -> None:
    n, _ = usual(np.random.default_rng(2), 3 * BLOCK + 100)
    expected = np.flatnonzero(n)
    for budget in (0, len(expected), int(n.sum()) - 1):
        frame = bench.begin(GpuAllocation(ctx), n, budget)
        assert frame.listed is None, "it would be beside what the predictor reads"
        frame.solve(ctx.buffer(np.ones((len(n), 2), dtype=np.float32)))
        assert frame.listed is not None
        listed = np.frombuffer(frame.listed.read(4 * len(expected)), dtype=np.uint32)
        assert np.array_equal(np.sort(listed), expected)


def test_every_pixel_gets_a_thread_also_beyond_the_groups_of_one_dimension(bench: Bench, ctx: moderngl.Context) -> None:
    pixels = 65535 * 64 + 1000
    frame = bench.begin(GpuAllocation(ctx), np.full(pixels, 2), pixels)
    program = ctx.compute_shader(
        """#version 450
        layout(local_size_x = 64) in;
        layout(std430, binding = 1) buffer Visits { uint visits[]; };
        layout(std430, binding = 0) buffer State { uint state[]; };
        void main() {
            uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
            uint i = 64u * group + gl_LocalInvocationIndex;
            if (i < state[1] + 64u) atomicAdd(visits[i], 1u);
        }"""
    )
    visits = ctx.buffer(np.zeros(pixels + 64, dtype=np.uint32))
    visits.bind_to_storage_buffer(1)
    frame.run_pixels(program, 0)
    seen = np.frombuffer(visits.read(), dtype=np.uint32)
    assert (seen[:pixels] == 1).all()
    assert (seen[pixels:] <= 1).all(), "the last group may be partly beyond the pixels"


def test_the_state_is_laid_out_as_the_shaders_have_it() -> None:
    assert STATE.itemsize == 4 * (12 + 64)
    assert STATE.fields is not None
    assert [STATE.fields[name][1] for name in ("count_groups", "edge")] == [36, 48]
    assert LAST < 2**21, "indices and their differences are far from 32 bits"
