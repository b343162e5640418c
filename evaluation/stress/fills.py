"""Fills of a budget and cuts at whole bins against float64 thresholds; sums of 1e7 importances in every order."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numba import njit
from numpy.typing import NDArray

from evaluation.stress.allocations import edge_budgets
from evaluation.stress.bounds import counted, within
from evaluation.stress.findings import Finding, Options, worst_of
from evaluation.stress.threads import one_thread
from labeller.curves import Curves
from renderer.allocation.cuts import FULL, MOST_CORE, Cuts, Events, events_of, solve_cuts
from renderer.allocation.fill import budget_fill
from renderer.allocation.prices import LEAST_PRICE, PRICE_STEPS, RANKS, ranks_of
from schemas.tail import DENSITY_G

Counts = NDArray[np.int32]
Numbers = NDArray[np.float32]


def run(options: Options) -> Iterator[Finding]:
    """Fills and whole bins at every edge budget, then the sums."""
    rng = np.random.default_rng(options.seed)
    pixels = 300 if options.quick else 2000
    n = np.where(rng.random(pixels) < 0.02, 4096, rng.integers(0, 7, pixels)).astype(np.int32)
    limits = []
    for name, weights in weight_cases(rng, pixels).items():
        found = [(f, budget_fill(weights, n, f)) for f in edge_budgets(n)]
        limits.append(_limits(f"weights {name}", n, found))
        yield _order_of_weights(name, n, weights, found)
    yield worst_of(limits, f"{len(limits)} inputs, every F")
    yield from _whole_bins(rng, pixels)
    yield from _sums(rng, 100_000 if options.quick else 10_000_000)


def weight_cases(rng: np.random.Generator, pixels: int) -> dict[str, Numbers]:
    """Importances of all kinds, float32 [P]."""
    return {
        name: values.astype(np.float32)
        for name, values in {
            "random": rng.random(pixels),
            "all 0": np.zeros(pixels),
            "all equal": np.full(pixels, 1 / 3),
            "1e-45 to 3e38": 10.0 ** rng.uniform(-44.8, 38.0, pixels),
            "one of 1, others of 1e-7": np.where(np.arange(pixels) == pixels // 2, 1.0, 1e-7),
            "0 and 1": rng.integers(0, 2, pixels),
            "1 ulp apart": 1.0 + rng.integers(0, 3, pixels) * 2.0**-23,
        }.items()
    }


def price_cases(rng: np.random.Generator, pixels: int, bins: int) -> dict[str, Numbers]:
    """Prices of bins of all kinds, float32 [P, bins], in any order; such as a network that overflows answers, too."""
    shape = (pixels, bins)
    usual = rng.normal(8.0, 6.0, shape)
    bad = rng.choice([np.nan, np.inf, -np.inf, 0.0], shape)
    cases = {
        "random": usual,
        "rising": np.sort(usual, axis=1),
        "falling": -np.sort(-usual, axis=1),
        "all equal": np.full(shape, 8.0),
        "halfway between two ranks, 1 ulp apart": (rng.integers(0, 40, shape) + 0.5) / PRICE_STEPS
        + rng.integers(-1, 2, shape) * 2.0**-21,
        "huge": rng.choice([-1e30, 1e30], shape),
        "all NaN": np.full(shape, np.nan),
        "NaN or infinite": np.where(bad == 0.0, usual, bad),
    }
    return {name: prices.astype(np.float32) for name, prices in cases.items()}


def _limits(name: str, n: Counts, found: list[tuple[int, Counts]]) -> Finding:
    wrong, where = 0, ""
    for budget, k in found:
        count = abs(int(k.sum()) - min(budget, int(n.sum()))) + int(((k < 0) | (k > n)).sum())
        if count:
            wrong, where = wrong + count, f"F {budget}"
    return counted("fill.limits", name, wrong, where)


def _order_of_weights(name: str, n: Counts, weights: Numbers, found: list[tuple[int, Counts]]) -> Finding:
    """A pixel's j-th fragment comes at the scale `j / weight`: what was given must come before what was not."""
    w = weights.astype(np.float64)
    late, places = [], []
    for budget, k in found:
        with np.errstate(divide="ignore"):
            given, missing = (k > 0) & (w > 0.0), (k < n) & (w > 0.0)
            last = (k[given] / w[given]).max(initial=0.0)
            first = ((k[missing] + 1) / w[missing]).min(initial=math.inf)
        late.append(max(last / first - 1.0, 0.0) if math.isfinite(first) else 0.0)
        places.append(f"F {budget}")
    return within("fill.budget", name, np.array(late), np.zeros(len(late)), places)


def _whole_bins(rng: np.random.Generator, pixels: int) -> Iterator[Finding]:
    """Cuts at every edge budget: limits, and the order in which bins are granted."""
    counts = bin_counts(rng, pixels)
    n, limits = whole_bins(counts), []
    for name, prices in price_cases(rng, *counts.shape).items():
        events = events_of(ranks_of(prices, counts), counts)
        found = [(f, solve_cuts(events, f)) for f in edge_budgets(n.sum(axis=1))]
        limits.append(_cut_limits(name, n, events, found))
        yield _order_of_bins(name, n, exact_ranks(prices, counts), found)
    yield worst_of(limits, f"{len(limits)} inputs, every F")


def bin_counts(rng: np.random.Generator, pixels: int, bins: int = 12) -> NDArray[np.uint8]:
    """Fragments of every bin, uint8 [P, bins]: few or none, as many as a count holds, more than a core may have."""
    few = np.where(rng.random((pixels, bins)) < 0.6, 0, rng.integers(0, 7, (pixels, bins)))
    many = rng.choice([0, 1, 200, FULL - 1, FULL], (pixels, bins))
    return np.where(rng.random((pixels, 1)) < 0.1, many, few).astype(np.uint8)


def whole_bins(counts: NDArray[np.uint8]) -> NDArray[np.int64]:
    """int64 [P, B], fragments of bins that can be in a core, in plain Python; 0 from the first one that cannot.

    Args:
        counts: uint8 [P, B], fragments of each bin, 255 for that many or more.
    """
    usable = np.zeros(counts.shape, np.int64)
    for row, out in zip(counts.tolist(), usable, strict=True):
        total = 0
        for b, own in enumerate(row):
            total += own
            if own == FULL or total > MOST_CORE:
                break
            out[b] = own
    return usable


def _cut_limits(name: str, n: NDArray[np.int64], events: Events, found: list[tuple[int, Cuts]]) -> Finding:
    """Fragments above F, cores that are not whole bins, and what is left where the next pixel's bins would fit."""
    wrong, where = 0, ""
    for budget, cuts in found:
        inside = np.arange(n.shape[1]) < cuts.cut[:, None]
        left = budget - int(cuts.k.sum())
        count = max(-left, 0) + int((cuts.k != (n * inside).sum(axis=1)).sum())
        waiting = (n > 0) & ~inside
        if waiting.any():
            first = waiting & (np.cumsum(waiting, axis=1) == 1)
            rank = events.rank[waiting].min()
            count += int(left >= n[first & (events.rank == rank)].max())
        if count:
            wrong, where = wrong + count, f"F {budget}"
    return counted("fill.limits", f"cuts, prices {name}", wrong, where)


def _order_of_bins(
    name: str, n: NDArray[np.int64], rank: NDArray[np.float64], found: list[tuple[int, Cuts]]
) -> Finding:
    """A bin comes at the price of it and of those in front of it: by how many ranks it is late."""
    late, places = [], []
    for budget, cuts in found:
        inside = np.arange(n.shape[1]) < cuts.cut[:, None]
        highest = rank[inside & (n > 0)].max(initial=-math.inf)
        late.append(max(highest - rank[~inside & (n > 0)].min(initial=math.inf), 0.0))
        places.append(f"F {budget}")
    return within("fill.cuts", name, np.array(late), np.zeros(len(late)), places)


def exact_ranks(prices: Numbers, counts: NDArray[np.integer]) -> NDArray[np.float64]:
    """`renderer.allocation.prices.ranks_of` before it is rounded down, in plain Python.

    Args:
        prices: float64 [P, B], negated log gain per fragment.
        counts: Integers [P, B], fragments of each bin.
    """
    ranks = np.zeros(prices.shape)
    for row, own, out in zip(prices.tolist(), counts.tolist(), ranks, strict=True):
        most = 0.0
        for b, price in enumerate(row):
            here = RANKS - 1.0 if math.isnan(price) else (price - LEAST_PRICE) * PRICE_STEPS + 0.5
            most = max(most, min(here, RANKS - 1.0)) if own[b] else most
            out[b] = most
    return ranks


def _sums(rng: np.random.Generator, count: int) -> Iterator[Finding]:
    """Sums in several orders, in float64 and in one float32 accumulator, against the exactly rounded sum."""
    for name, values in (
        ("uniform", rng.random(count)),
        ("one of 1e7, others of 1e-1", np.where(np.arange(count) == 0, 1e7, 0.1)),
        ("VKB-like", np.maximum(0.0, 0.3 + 0.1 * (rng.random(count) - 0.5))),
        ("1e-30 to 1", 10.0 ** rng.uniform(-30.0, 0.0, count)),
    ):
        numbers = values.astype(np.float32)
        truth = math.fsum(numbers.tolist())
        orders = {
            "forward": numbers,
            "reversed": numbers[::-1],
            "shuffled": rng.permutation(numbers),
            "ascending": np.sort(numbers),
        }
        used = {order: _total(x) for order, x in orders.items()}
        used["16 chunks"] = sum(_total(x) for x in np.array_split(numbers, 16))
        naive = {order: float(_float32_sum(np.ascontiguousarray(x))) for order, x in orders.items()}
        naive["16 chunks"] = float(sum((_float32_sum(x) for x in np.array_split(numbers, 16)), np.float32(0.0)))
        for path, sums in (("sum", used), ("sum.rejected", naive)):
            case = f"{count:.0e} importances, {name}"
            yield within(path, case, np.array(list(sums.values())), np.full(len(sums), truth), list(sums))
    yield from _fill_in_any_order(rng, count)


def _total(errors: Numbers) -> float:
    """What a view's errors add up to, by the code that does it: each number is a pixel's error at k = 0."""
    return Curves(np.arange(len(errors) + 1), errors, "density", DENSITY_G, "display").total(np.zeros(len(errors), int))


@njit(cache=True)
def _float32_sum(values: Numbers) -> np.float32:
    total = np.float32(0.0)
    for value in values:
        total += value
    return total


def _fill_in_any_order(rng: np.random.Generator, count: int) -> Iterator[Finding]:
    n = rng.integers(0, 9, count).astype(np.int32)
    budget = int(0.4 * n.sum())
    # Weights without a pattern: no two pixels have fragments at the same scale, a tie that the index would decide.
    weights = rng.uniform(0.1, 1.0, count)
    plain = budget_fill(weights, n, budget)
    for name, order in (("reversed", np.arange(count)[::-1]), ("shuffled", rng.permutation(count))):
        moved = np.empty_like(plain)
        moved[order] = budget_fill(weights[order], n[order], budget)
        wrong = np.flatnonzero(moved != plain)
        yield counted("fill.order", f"{count:.0e} importances, {name}", len(wrong), f"pixel {wrong[:1]}")
    with one_thread():
        alone = budget_fill(weights, n, budget)
    yield counted("fill.order", f"{count:.0e} importances, 1 thread", int((alone != plain).sum()))
