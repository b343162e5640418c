"""Error curves: the values that are known beforehand, and dumps that are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.curves import split
from support.dumps import dump_of, random_dump

from labeller import reference
from labeller.curves import UNREACHABLE, composite, error_curves, whole_bins
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from schemas.colour import decode_gamma2
from schemas.fragments import FragmentDump
from schemas.problem import Problem
from schemas.tail import BINNED_TAILS, TAILS, TailName


def with_depth(depth: list[float]) -> FragmentDump:
    return dump_of([(np.full((len(depth), 4), 100, np.uint8), np.array(depth, np.float32))])


@pytest.mark.parametrize("tail", TAILS)
def test_all_fragments_in_the_core_are_exact(tail: TailName) -> None:
    dump = random_dump(20, 20, 9, seed=1)
    curves = error_curves(dump, tail)
    assert np.all(curves.at(dump.counts) == 0.0)
    assert curves.total(dump.counts) == 0.0
    assert np.array_equal(composite(dump, dump.counts, tail), composite(dump, dump.counts + 5, "paper"))


@pytest.mark.parametrize("tail", ["density", "exact-coverage", "weighted-average"])
def test_one_fragment_in_the_tail_is_lossless(tail: TailName) -> None:
    dump = random_dump(20, 20, 9, seed=2)
    errors = error_curves(dump, tail).at(np.maximum(dump.counts - 1, 0))
    assert errors.max() <= 1e-9
    np.testing.assert_allclose(
        composite(dump, np.maximum(dump.counts - 1, 0), tail), composite(dump, dump.counts, tail), atol=1e-6
    )


def test_the_paper_tail_loses_its_opacity_factor() -> None:
    dump = dump_of([(np.array([[200, 40, 40, 85]], np.uint8), np.array([1.0], np.float32))])
    assert error_curves(dump, "paper").error[0] > 0.003
    red, white, alpha = decode_gamma2(np.array([200, 40, 40], np.uint8)), np.ones(3), 85 / 255
    np.testing.assert_allclose(composite(dump, np.zeros(1, int), "paper")[0], red + (1 - alpha) * white, rtol=1e-6)


def test_pixels_without_fragments_show_the_background() -> None:
    empty = (np.empty((0, 4), np.uint8), np.empty(0, np.float32))
    dump = dump_of([empty, empty], background=(10, 128, 255))
    assert error_curves(dump).error.tolist() == [0.0, 0.0]
    np.testing.assert_allclose(composite(dump, np.zeros(2, int)), decode_gamma2(dump.background), rtol=1e-6)


def test_the_density_tail_with_g_0_is_exact_coverage() -> None:
    dump = random_dump(15, 15, 9, seed=3)
    assert np.array_equal(error_curves(dump, "density", 0.0).error, error_curves(dump, "exact-coverage").error)


def test_the_density_tail_is_closer_than_a_plain_mean_where_near_fragments_hide_far_ones() -> None:
    dump = random_dump(40, 40, 12, seed=4, alpha=0.5)
    none = np.zeros(dump.pixels, int)
    assert error_curves(dump, "density").total(none) < 0.7 * error_curves(dump, "exact-coverage").total(none)


def test_curves_do_not_depend_on_the_number_of_threads() -> None:
    numba = pytest.importorskip("numba")
    dump, threads = random_dump(50, 40, 9, seed=5), numba.get_num_threads()
    many = error_curves(dump).error
    numba.set_num_threads(1)
    try:
        assert np.array_equal(error_curves(dump).error, many)
    finally:
        numba.set_num_threads(threads)


@pytest.mark.parametrize("depth", [[1.0, float("nan")], [1.0, float("inf")], [0.0, 1.0], [-1.0]])
def test_depths_that_are_no_positive_numbers_are_refused(depth: list[float]) -> None:
    with pytest.raises(Problem, match="depths that are not positive numbers"):
        error_curves(with_depth(depth))


def test_lists_that_do_not_fit_are_refused() -> None:
    dump = with_depth([1.0, 2.0])
    for broken in (
        replace(dump, offsets=np.array([0, 3])),
        replace(dump, offsets=np.array([0, 1, 2])),
        replace(dump, rgba=dump.rgba[:1]),
        replace(dump, background=dump.background[:0]),
        replace(dump, facing=dump.facing[:0]),
        replace(dump, rgba=dump.rgba[:, :3]),
        replace(dump, rgba=dump.rgba.astype(np.int64)),
        replace(dump, depth=dump.depth.astype(">f4")),
        replace(dump, offsets=dump.offsets.astype(np.uint64)),
    ):
        with pytest.raises(Problem, match="malformed"):
            composite(broken, np.zeros(1, int))


@pytest.mark.parametrize(
    "tile_range",
    [
        np.zeros((3, 2), np.float32),
        np.zeros((4, 1), np.float32),
        np.zeros((4, 2), np.float64),
        np.full((4, 2), np.nan, np.float32),
        np.array([[1.0, np.inf]] * 4, np.float32),
    ],
)
def test_ranges_that_are_not_a_pair_of_numbers_a_tile_are_refused(tile_range: np.ndarray) -> None:
    dump = replace(random_dump(12, 9, 4, seed=1), tile_range=tile_range)
    with pytest.raises(Problem, match="malformed"):
        error_curves(dump)


def cuts_of(dump: FragmentDump, p: int, tail: TailName) -> set[int]:
    """Every k that is all fragments of a pixel's first bins, from the plain account of its bins."""
    pixel, row = reference.pixel_of(dump, p), TAILS[tail]
    if pixel.n == 0:
        return {0}
    bins = reference.depth_bins(pixel, -np.log(np.maximum(1.0 - pixel.alpha, 1e-3)), row).bin
    return {int((bins < cut).sum()) for cut in range(row.bins + 1)}


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_of_whole_bins_only_cuts_can_be_reached(tail: TailName) -> None:
    dump = random_dump(9, 7, 30, seed=6)
    curves = error_curves(dump, tail)
    cut = whole_bins(dump, curves)
    others = 0
    for p, (before, after) in enumerate(zip(split(curves), split(cut), strict=True)):
        reached = cuts_of(dump, p, tail)
        assert set(np.flatnonzero(after < UNREACHABLE)) == reached
        assert all(after[k] == before[k] for k in reached)
        others += len(after) - len(reached)
    assert others > 0


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_hulls_of_whole_bins_have_cuts_for_vertices(tail: TailName) -> None:
    dump = random_dump(9, 7, 30, seed=7)
    hulls = lower_hulls(whole_bins(dump, error_curves(dump, tail)))
    for p in range(dump.pixels):
        own = slice(hulls.offsets[p], hulls.offsets[p + 1])
        assert set(hulls.k[own]) <= cuts_of(dump, p, tail)
        assert (hulls.error[own] < UNREACHABLE).all()


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_the_optimum_of_whole_bins_is_of_cuts_and_certified(tail: TailName) -> None:
    dump = random_dump(6, 5, 12, seed=8)
    curves = whole_bins(dump, error_curves(dump, tail))
    any_k = error_curves(dump, tail)
    budgets = [0, 1, dump.pixels // 2, dump.total // 4, dump.total // 2, dump.total - 1]
    best = [reference.optimum(split(curves), budget) for budget in budgets]
    found = allocate_curves(dump, curves, budgets, "optimal")
    for budget, allocation, least in zip(budgets, found, best, strict=True):
        assert allocation.used <= budget
        assert all(int(k) in cuts_of(dump, p, tail) for p, k in enumerate(allocation.k))
        assert allocation.error < UNREACHABLE
        bound = allocation.error if allocation.bound is None else allocation.bound
        assert bound <= least * (1.0 + 1e-6) <= allocation.error * (1.0 + 2e-6)
    free = [x.error for x in allocate_curves(dump, any_k, budgets, "optimal")]
    assert all(y.error >= x * (1.0 - 1e-6) for x, y in zip(free, found, strict=True))
