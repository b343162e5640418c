"""The compute passes that choose cuts against their twin in numpy: the same to the bit, on every driver."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from evaluation.stress.fills import price_cases
from evaluation.stress.gl_allocation import packed_bins, placed_cores
from renderer.allocation.cuts import FULL, MOST_CORE, events_of, solve_cuts, usable_counts
from renderer.allocation.gpu import BLOCK, STATE, AllocationState, FrameAllocation
from renderer.allocation.prices import RANKS, ranks_of
from renderer.bin_pass import Binned
from renderer.programs import Programs
from schemas.tail import BINNED_TAILS, TAILS, TailName

Ranks = NDArray[np.uint8]
NAMES = list(price_cases(np.random.default_rng(0), 1, 8))


@dataclass
class Placed:
    """What the passes made of a frame, as they leave it for capturing."""

    cut: NDArray[np.int64]
    cursor: NDArray[np.int64]
    offset: NDArray[np.int64]
    state: AllocationState


@dataclass
class Bench:
    """Runs the passes on arrays."""

    ctx: moderngl.Context
    programs: Programs

    def begin(
        self, ranks: Ranks, counts: NDArray[np.integer], budget: int, tail: TailName = "binned-8"
    ) -> tuple[FrameAllocation, Binned]:
        binned = packed_bins(self.ctx, tail, counts.astype(np.uint8), ranks)
        allocation = FrameAllocation(self.ctx, self.programs, binned, len(counts), budget)
        allocation.begin()
        return allocation, binned

    def place(self, ranks: Ranks, counts: NDArray[np.integer], budget: int, tail: TailName = "binned-8") -> Placed:
        allocation, binned = self.begin(ranks, counts, budget, tail)
        allocation.place()
        offset, cut, cursor = placed_cores(binned)
        return Placed(cut, cursor, offset, allocation.read_state())


@pytest.fixture(scope="module")
def bench(gl: moderngl.Context) -> Bench:
    return Bench(gl, Programs(gl))


def usual(rng: np.random.Generator, pixels: int, bins: int = 8) -> tuple[Ranks, NDArray[np.int64]]:
    """Ranks and counts as pictures have them, some bins full, some pixels empty."""
    counts = rng.integers(0, 5, (pixels, bins)) * rng.integers(0, 2, (pixels, bins))
    counts[rng.random(pixels) < 0.3] = 0
    counts[rng.random((pixels, bins)) < 0.002] = FULL
    counts[rng.random((pixels, bins)) < 0.002] = FULL - 1
    return ranks_of(rng.normal(8.0, 4.0, (pixels, bins)).astype(np.float32), counts), counts


def edge_budgets(counts: NDArray[np.integer]) -> list[int]:
    total = int(usable_counts(counts).sum())
    return sorted({0, 1, total // 7, total // 2, max(total - 1, 0), total, 2 * total, 2**33})


def assert_is_the_twins(found: Placed, ranks: Ranks, counts: NDArray[np.integer], budget: int) -> None:
    expected = solve_cuts(events_of(ranks, counts), budget)
    assert np.array_equal(found.cut, expected.cut)
    assert found.state.complete == (expected.rank is None)
    assert found.state.rank == expected.rank
    assert found.state.occupied == np.count_nonzero(counts.any(axis=1))
    # Runs of the pool: as long as k where anything is captured, one after the other, within the budget.
    assert np.array_equal(found.cursor, found.offset)
    ends = found.offset + expected.k
    assert (ends[:-1] <= found.offset[1:]).all()
    assert ends.max(initial=0) <= budget
    assert expected.k.sum() <= budget


@pytest.mark.parametrize("pixels", [1, 63, 127, BLOCK - 1, BLOCK, BLOCK + 1, 9 * BLOCK + 777])
def test_cuts_equal_the_twins_for_every_size(bench: Bench, pixels: int) -> None:
    ranks, counts = usual(np.random.default_rng(pixels), pixels)
    for budget in edge_budgets(counts):
        assert_is_the_twins(bench.place(ranks, counts, budget), ranks, counts, budget)


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_cuts_equal_the_twins_for_every_tail(bench: Bench, tail: TailName) -> None:
    ranks, counts = usual(np.random.default_rng(1), 3000, TAILS[tail].bins)
    for budget in edge_budgets(counts):
        assert_is_the_twins(bench.place(ranks, counts, budget, tail), ranks, counts, budget)


@pytest.mark.parametrize("name", NAMES)
def test_prices_of_all_kinds_give_the_twins_cuts(bench: Bench, name: str) -> None:
    rng = np.random.default_rng(5)
    _, counts = usual(rng, 3000)
    ranks = ranks_of(price_cases(rng, 3000, 8)[name], counts)
    for budget in edge_budgets(counts):
        assert_is_the_twins(bench.place(ranks, counts, budget), ranks, counts, budget)


def test_equal_prices_over_many_blocks_go_by_index(bench: Bench) -> None:
    pixels = 5 * BLOCK + 99
    counts = np.tile([0, 3, 0, 0, 2, 0, 0, 1], (pixels, 1))
    ranks = np.tile(np.array([0, 40, 40, 40, 60, 60, 60, 80], np.uint8), (pixels, 1))
    for budget in (3 * pixels // 2, 3 * pixels + 1, 3 * pixels + 2 * (3 * BLOCK + 5) + 1, 5 * pixels + 7):
        found = bench.place(ranks, counts, budget)
        assert_is_the_twins(found, ranks, counts, budget)
        assert (np.diff(found.cut) <= 0).all()
        assert len(np.unique(found.cut)) == (1 if budget == 3 * pixels + 1 else 2)


def test_full_bins_and_the_longest_core_end_it(bench: Bench) -> None:
    rows = [
        [FULL, 1, 1, 1, 1, 1, 1, 1],
        [1, FULL, 1, 1, 1, 1, 1, 1],
        [254, 254, 254, 254, 7, 1, 0, 1],
        [254, 254, 254, 254, 8, 1, 0, 1],
        [0, 0, 0, 0, 0, 0, 0, FULL],
    ]
    counts = np.array(rows)
    ranks = np.tile(np.arange(8, dtype=np.uint8), (len(rows), 1))
    found = bench.place(ranks, counts, 10_000)
    assert found.cut.tolist() == [0, 1, 5, 4, 0]
    assert found.state.complete, "all that can be in a core is"
    assert np.diff([*found.offset, found.offset[-1]]).tolist() == [0, 1, MOST_CORE, 4 * 254, 0]
    for budget in (1, 255, 1000, 2000):
        assert_is_the_twins(bench.place(ranks, counts, budget), ranks, counts, budget)


def test_a_frame_without_fragments_has_nothing_to_place(bench: Bench) -> None:
    counts = np.zeros((700, 8), np.int64)
    for budget in (0, 5):
        found = bench.place(counts.astype(np.uint8), counts, budget)
        assert not found.cut.any()
        assert not found.offset.any()
        assert (found.state.complete, found.state.occupied) == (True, 0)


def test_the_same_frame_is_placed_alike_every_time(bench: Bench) -> None:
    ranks, counts = usual(np.random.default_rng(9), 20_000)
    budget = int(usable_counts(counts).sum()) // 3
    first, again = (bench.place(ranks, counts, budget) for _ in range(2))
    for field in ("cut", "cursor", "offset"):
        assert np.array_equal(getattr(first, field), getattr(again, field))


def test_a_shader_visits_every_pixel_of_more_than_one_row_of_groups(bench: Bench, ctx: moderngl.Context) -> None:
    pixels = 65535 * 64 + 1000
    allocation, _ = bench.begin(np.zeros((pixels, 8), np.uint8), np.ones((pixels, 8), np.uint8), pixels)
    program = ctx.compute_shader(
        """#version 450
        layout(local_size_x = 64) in;
        layout(std430, binding = 2) buffer Visits { uint visits[]; };
        uniform uint pixels;
        void main() {
            uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
            uint i = 64u * group + gl_LocalInvocationIndex;
            if (i < pixels) atomicAdd(visits[i], 1u);
        }"""
    )
    visits = ctx.buffer(np.zeros(pixels, dtype=np.uint32))
    visits.bind_to_storage_buffer(2)
    allocation.run_pixels(program)
    assert (np.frombuffer(visits.read(), dtype=np.uint32) == 1).all()
    assert allocation.read_state().occupied == pixels


def test_the_state_is_laid_out_as_the_shaders_have_it() -> None:
    assert STATE.itemsize == 4 * (6 + RANKS)
    assert STATE.fields is not None
    assert [STATE.fields[name][1] for name in ("budget", "fragments", "rank", "counted")] == [0, 12, 16, 24]
