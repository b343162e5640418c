"""The compute passes that cut pixels at whole bins against their twin in numpy, which `fills` judges."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from evaluation.stress.allocations import edge_budgets
from evaluation.stress.fills import bin_counts, price_cases, whole_bins
from evaluation.stress.findings import Finding, Options, compared
from evaluation.stress.gl_bounds import bound_of
from renderer.allocation.cuts import Cuts, events_of, solve_cuts
from renderer.allocation.gpu import BLOCK, FrameAllocation
from renderer.allocation.prices import ranks_of
from renderer.bin_pass import CORE_WORDS, CURSOR_BITS, Binned
from renderer.programs import Programs
from schemas.tail import BINNED_TAILS, TAILS, TailName

PATH = "allocation"


def rows(ctx: moderngl.Context, options: Options, driver: str) -> Iterator[Finding]:
    """All kinds of prices and counts at every edge budget.

    Args:
        ctx: The context.
        options: The seed; quick runs have fewer pixels.
        driver: For the paths.
    """
    rng = np.random.default_rng(options.seed)
    pixels = BLOCK + 100 if options.quick else 20 * BLOCK + 100
    bound, programs, path = bound_of(PATH, deep=False), Programs(ctx), f"{PATH} · {driver}"
    for tail in BINNED_TAILS:
        counts = bin_counts(rng, pixels, TAILS[tail].bins)
        n = whole_bins(counts).sum(axis=1)
        for name, prices in price_cases(rng, *counts.shape).items():
            ranks = ranks_of(prices, counts)
            events = events_of(ranks, counts)
            for budget in {*edge_budgets(n), 1}:
                truth = solve_cuts(events, budget)
                found = _placed(ctx, programs, tail, ranks, counts, budget, truth)
                expected = np.stack([truth.cut, np.zeros(pixels)], axis=1)
                row = compared(path, "ranks", found, expected, bound.value, bound.measure, bound.floor)
                yield replace(row, where=f"{tail}, {name}, F {budget}, {row.where}")


def _placed(
    ctx: moderngl.Context,
    programs: Programs,
    tail: TailName,
    ranks: NDArray[np.uint8],
    counts: NDArray[np.uint8],
    budget: int,
    truth: Cuts,
) -> NDArray[np.float64]:
    """float64 [P, 2], the cut of every pixel, and the fragments of the true one that its run has no room for."""
    binned = packed_bins(ctx, tail, counts, ranks)
    allocation = FrameAllocation(ctx, programs, binned, len(counts), budget)
    allocation.begin()
    allocation.place()
    begin, cut, _ = placed_cores(binned)
    room = np.diff(begin, append=budget)
    return np.stack([cut, np.maximum(truth.k - room, 0)], axis=1).astype(np.float64)


def packed_bins(ctx: moderngl.Context, tail: TailName, counts: NDArray[np.uint8], ranks: NDArray[np.uint8]) -> Binned:
    """A pixel's words as packing and predicting leave them.

    Args:
        ctx: The context.
        tail: A tail with bins.
        counts: uint8 [P, B], fragments of the bins.
        ranks: uint8 [P, B], of their prices.
    """
    bins = TAILS[tail].bins
    words = np.zeros((len(counts), bins), dtype=np.uint32)
    both = np.concatenate([counts, ranks], axis=1, dtype=np.uint8)
    words[:, bins // 2 :] = both.view(np.uint32)
    return Binned(tail, TAILS[tail], ctx.buffer(words), len(counts), ctx.buffer(reserve=8))


def placed_cores(binned: Binned) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """int64 [P] each: where a pixel's run begins, its cut, its cursor."""
    begin, core = binned.read()[:, binned.tail.bins // 2 :][:, :CORE_WORDS].astype(np.int64).T
    return begin, core >> CURSOR_BITS, core & (1 << CURSOR_BITS) - 1
