"""Hulls, selections, greedy rules and certified optima, against exact arithmetic, the literal heap, a full search."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.bounds import PIXEL_FLOOR, counted, within
from evaluation.stress.cases import Case, curve_cases, dump_of, random_dump, some_list
from evaluation.stress.findings import Finding, Options, worst_of
from evaluation.stress.threads import one_thread
from evaluation.stress.twins import exact_hull
from labeller import reference
from labeller.allocation import RULES, Allocation, RuleName
from labeller.curves import Curves, error_curves
from labeller.error_rules import ErrorRule
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from labeller.selection import END, Histogram, ascending_keys
from labeller.streaming import allocate_bands
from schemas.fragments import FragmentDump
from schemas.tail import RANGE_TILE, TAIL_NAMES

_EXACT: Final = 64  # hulls of longer lists are not made in rational arithmetic
_SMALL: Final = 40  # fragments up to which a full search is made
_LITERAL: Final = 4096  # fragments up to which the literal heap is run
_TRIED: Final = {
    "hull": "every k",
    "hull.slopes": "every k",
    "greedy": "every F",
    "increment": "every F",
    "limits": "every rule, every F",
    "optimal.greedy": "every F",
}
_BY_ERROR: Final[tuple[ErrorRule, ...]] = ("optimal", "greedy", "increment")
_HEAPS: Final[tuple[tuple[RuleName, Literal["absolute", "increment"]], ...]] = (
    ("greedy", "absolute"),
    ("increment", "increment"),
)


def run(options: Options) -> Iterator[Finding]:
    """Every stage from curves to counts, on the cases, on curves made by hand and on many small views."""
    rng = np.random.default_rng(options.seed)
    pictures = [(case.name, case.dump, error_curves(case.dump)) for case in curve_cases(options.quick, options.seed)]
    made = [(name, _dump_for(curves), curves) for name, curves in handmade(rng, options.quick)]
    yield from _selections(rng)
    for kind, cases in (("curves of", pictures), ("curves made by hand:", made)):
        with one_thread():
            found = [finding for name, dump, curves in cases for finding in _allocated(name, dump, curves)]
        for path in dict.fromkeys(finding.path for finding in found):
            rows = [finding for finding in found if finding.path == path]
            yield worst_of(rows, f"{kind} {len(rows)} inputs, {_TRIED[path]}")
    yield from _bands(options)
    yield from _bounds(options)
    yield from _rising(options)


def _allocated(name: str, dump: FragmentDump, curves: Curves) -> Iterator[Finding]:
    yield from _hulls(name, curves)
    if dump.total <= _LITERAL:
        yield from _heaps(name, dump, curves)
    yield _limits(name, dump, curves)
    yield _never_above(name, dump, curves)


def edge_budgets(n: NDArray[np.integer]) -> list[int]:
    """F in {0, occupied - 1, occupied, N - 1, N, 2N}, and half of N.

    Args:
        n: Integers [P], fragments of each pixel.
    """
    occupied, total = int(np.count_nonzero(n)), int(n.sum())
    return sorted({max(0, f) for f in (0, occupied - 1, occupied, total // 2, total - 1, total, 2 * total)})


def handmade(rng: np.random.Generator, quick: bool) -> list[tuple[str, Curves]]:
    """Curves that no picture need have: ties, straight lines, plateaus, numbers from denormal to huge."""
    pixels = 60 if quick else 300
    n = rng.integers(0, 12, pixels)
    spans = {
        "errors all equal": [np.full(m, 0.25) for m in n],
        "straight lines": [np.arange(m, 0, -1) / 16.0 for m in n],
        "lines straight up to a rounding": [np.arange(m, 0, -1) * rng.random() for m in n],
        "errors of three values": [rng.choice([0.0, 0.5, 1.0], m) for m in n],
        "all errors 0": [np.zeros(m) for m in n],
        "errors from denormal to huge": [10.0 ** rng.uniform(-44.0, 37.0, m) for m in n],
        "errors 1 ulp apart": [
            np.nextafter(np.float32(1.0), np.float32(2.0)) - rng.integers(0, 3, m) * 2.0**-24 for m in n
        ],
        "rising, then 0": [np.arange(1, m + 1) / 7.0 for m in n],
    }
    return [(name, _curves([np.append(e, 0.0) for e in errors])) for name, errors in spans.items()]


def _curves(errors: Sequence[NDArray[np.floating]]) -> Curves:
    offsets = np.concatenate([[0], np.cumsum([len(e) for e in errors])]).astype(np.int64)
    return Curves(offsets, np.concatenate([e.astype(np.float32) for e in errors]), "density", 0.75, "display")


def _dump_for(curves: Curves) -> FragmentDump:
    grey = np.full((int(curves.counts.max(initial=0)), 4), 128, np.uint8)
    depth = np.arange(1, len(grey) + 1, dtype=np.float32)
    return dump_of([(grey[:n], depth[:n]) for n in curves.counts])


def _split(curves: Curves) -> list[NDArray[np.float32]]:
    return np.split(curves.error, curves.offsets[1:-1])


def _hulls(name: str, curves: Curves) -> Iterator[Finding]:
    """Hulls at every k against rational arithmetic, and slopes that do not rise."""
    found: list[float] = []
    truth: list[float] = []
    places: list[str] = []
    rising = 0
    hulls = lower_hulls(curves)
    slopes, _ = hulls.steps()
    for p, curve in enumerate(_split(curves)):
        part = slice(hulls.offsets[p], hulls.offsets[p + 1])
        rising += int((np.diff(slopes[part]) > 0.0).sum())
        if len(curve) > _EXACT or curve[0] == 0.0:
            continue
        exact = exact_hull(curve)
        k = np.arange(len(exact))
        found += np.interp(k, hulls.k[part], hulls.error[part].astype(np.float64)).tolist()
        truth += [float(x) for x in exact]
        places += [f"pixel {p}, k {i}" for i in k]
    yield counted("hull.slopes", name, rising)
    if found:
        yield within("hull", name, np.array(found), np.array(truth), places)


def _selections(rng: np.random.Generator) -> Iterator[Finding]:
    """Thresholds of the histogram selection against prefix sums of a sorted list."""
    count = 20_000
    for name, values in (
        ("random keys", rng.normal(size=count)),
        ("all keys equal", np.full(count, 0.25)),
        ("keys 1 ulp apart", 1.0 + rng.integers(0, 4, count) * 2.0**-23),
        ("denormal to huge, both signs", rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-44.0, 38.0, count)),
        ("keys 0 and infinity", rng.choice([0.0, np.inf], count)),
    ):
        numbers = values.astype(np.float32)
        weights = rng.integers(0, 5, count).astype(np.int32)
        keys = ascending_keys(numbers.copy())
        order = np.argsort(numbers, kind="stable")
        wrong, where = int((np.diff(keys[order].astype(np.int64)) < 0).sum()), "order of the keys"
        total = int(weights.sum())
        targets = [0, 1, total // 3, total - 1, total, 2 * total]
        items = [(keys, weights)]
        for target, found in zip(targets, Histogram(items).thresholds(targets, partial(list, items)), strict=True):
            below, upto = int(weights[keys < found.key].sum()), int(weights[keys <= found.key].sum())
            if not (below == found.below <= target and (upto > target or found.key == END)):
                wrong, where = wrong + 1, f"target {target}"
        yield counted("selection", name, wrong, where if wrong else "")


def _heaps(name: str, dump: FragmentDump, curves: Curves) -> Iterator[Finding]:
    """The removal order by selection against the literal heap, bit for bit."""
    split = _split(curves)
    for path, key in _HEAPS:
        differ, where = 0, ""
        for found in allocate_curves(dump, curves, edge_budgets(dump.counts), path):
            wrong = np.flatnonzero(found.k != reference.heap_removal(split, found.budget, key))
            if len(wrong):
                differ, where = differ + len(wrong), f"F {found.budget}, pixel {wrong[0]}"
        yield counted(path, name, differ, where)


def _limits(name: str, dump: FragmentDump, curves: Curves) -> Finding:
    """Every rule at every edge budget: counts in their limits, finite errors."""
    n, broken, where = dump.counts, 0, ""
    for rule in RULES:
        for found in allocate_curves(dump, curves, edge_budgets(n), rule):
            count = int(((found.k < 0) | (found.k > n)).sum())
            count += max(int(found.k.sum()) - found.budget, 0) + int(found.used != found.k.sum())
            count += int(not np.isfinite(found.error) or found.error < 0.0)
            if count:
                broken, where = broken + count, f"{rule}, F {found.budget}"
    return counted("limits", name, broken, where)


def _never_above(name: str, dump: FragmentDump, curves: Curves) -> Finding:
    """By how much `optimal` exceeds the greedy rules; negative differences count as none."""
    budgets = edge_budgets(dump.counts)
    optimal = allocate_curves(dump, curves, budgets, "optimal")
    best, truth, places = [], [], []
    for rule, _ in _HEAPS:
        for mine, other in zip(optimal, allocate_curves(dump, curves, budgets, rule), strict=True):
            best.append(max(mine.error, other.error))
            truth.append(other.error)
            places.append(f"{rule}, F {mine.budget}")
    return within("optimal.greedy", name, np.array(best), np.array(truth), places)


def _bands(options: Options) -> Iterator[Finding]:
    """Row bands one after the other against the whole view, for every rule that can be computed so."""
    rng = np.random.default_rng(options.seed)
    height, width = (20, 20) if options.quick else (48, 64)
    bands = (RANGE_TILE, 2 * RANGE_TILE, height)  # whole tiles: depth bins lie between the ends of a tile's range
    for name, ties in (("random view", False), ("depth ties across an image", True)):
        dump = replace(random_dump(rng, height * width, 9, ties), width=width, height=height)
        curves, budgets = error_curves(dump), edge_budgets(dump.counts)
        wrong, where = 0, ""
        for rule in _BY_ERROR:
            for rows in bands:
                parts = [_rows_of(dump, first, min(first + rows, height)) for first in range(0, height, rows)]
                whole = allocate_curves(dump, curves, budgets, rule)
                for one, other in zip(allocate_bands(partial(list, parts), budgets, rule), whole, strict=True):
                    differ = int((one.k != other.k).sum())
                    if differ:
                        wrong, where = wrong + differ, f"{rule}, {rows} rows a band, F {one.budget}"
        yield counted("bands", f"{name}, bands of {bands[0]}, {bands[1]} and {height} rows, every F", wrong, where)


def _rows_of(dump: FragmentDump, first: int, last: int) -> FragmentDump:
    pixels = slice(first * dump.width, last * dump.width)
    offsets = dump.offsets[pixels.start : pixels.stop + 1]
    part = slice(offsets[0], offsets[-1])
    return FragmentDump(
        width=dump.width,
        height=last - first,
        offsets=offsets - offsets[0],
        rgba=dump.rgba[part],
        depth=dump.depth[part],
        background=dump.background[pixels],
        facing=dump.facing[pixels],
    )


def _bounds(options: Options) -> Iterator[Finding]:
    """The certificate, against exhaustive dynamic programming, on small views and on one that is hard to prove."""
    rng = np.random.default_rng(options.seed)
    tries = 60 if options.quick else 1000
    for name, searches in (
        ("small views", _searched(rng, tries, ties=False)),
        ("small views, depth ties", _searched(rng, tries, ties=True)),
        ("what fits the rest is far from the price", _far_away()),
    ):
        with one_thread():
            searched = list(searches)
        optima = np.array([optimum for _, optimum, _ in searched])
        places = [place for _, _, place in searched]
        bounds = np.array([found.bound or 0.0 for found, _, _ in searched])
        errors = np.array([found.error for found, _, _ in searched])
        case = f"{name}, {len(searched)} searched in full"
        yield within("optimal.bound", f"{case}: bound <= optimum", np.maximum(bounds, optima), optima, places)
        yield within("optimal.bound", f"{case}: optimum <= error", np.minimum(errors, optima), optima, places)


def _searched(rng: np.random.Generator, tries: int, ties: bool) -> Iterator[tuple[Allocation, float, str]]:
    """Allocations of small views with the true optimum, and which they are."""
    for trial in range(tries):
        dump = random_dump(rng, int(rng.integers(1, 7)), _SMALL // 6, ties)
        curves = error_curves(dump, TAIL_NAMES[trial % len(TAIL_NAMES)])
        for found in allocate_curves(dump, curves, edge_budgets(dump.counts), "optimal"):
            optimum = reference.optimum(_split(curves), found.budget)
            yield found, optimum, f"view {trial}, F {found.budget}"


def _far_away() -> Iterator[tuple[Allocation, float, str]]:
    """Pixels that gain by pairs of fragments only: what gains by an odd one is 1200 dearer fragments away."""
    pairs = [np.array([9.0, 2.0, 2.0, 0.0]) * (1.0 + 1e-4 * i) for i in range(600)]
    curves = _curves([*pairs, np.array([9.0, 0.9, 0.0])])
    budgets = [len(curves.counts) + fragments for fragments in (1, 401, 601, 801)]
    for found in allocate_curves(_dump_for(curves), curves, budgets, "optimal"):
        yield found, reference.optimum(_split(curves), found.budget), f"F {found.budget}"


def _rising(options: Options) -> Iterator[Finding]:
    """The error of `optimal` over rising budgets."""
    rng = np.random.default_rng(options.seed)
    pixels = 400 if options.quick else 4000
    for case in (
        Case("random view", random_dump(rng, pixels, 9)),
        Case("depth ties across an image", random_dump(rng, pixels, 9, ties=True)),
        Case("lists of 0 to 60", dump_of([some_list(rng, int(rng.integers(0, 61))) for _ in range(pixels // 8)])),
    ):
        curves = error_curves(case.dump)
        budgets = np.linspace(0, case.dump.total, 40).astype(int).tolist()
        found: list[Allocation] = allocate_curves(case.dump, curves, budgets, "optimal")
        errors = np.array([x.error for x in found])
        least = np.minimum.accumulate(errors)
        floor = PIXEL_FLOOR * case.dump.pixels
        worst = int(np.argmax((errors - least) / np.maximum(least, floor)))
        scale = np.maximum(least, floor) / PIXEL_FLOOR  # so that the floor is per pixel
        yield within(
            "optimal.rising",
            f"{case.name}, 40 budgets",
            (errors - least) / scale + PIXEL_FLOOR,
            np.full(len(errors), PIXEL_FLOOR),
            [f"F {budgets[worst]} of {case.dump.total}"] * len(errors),
        )
