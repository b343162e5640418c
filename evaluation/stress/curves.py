"""Error curves, pictures and the reference itself: numba against plain float64, float64 against extended precision."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from evaluation.stress.bounds import counted, within
from evaluation.stress.cases import LONGEST, Case, curve_cases, dump_of
from evaluation.stress.findings import Finding, Options, worst_of
from evaluation.stress.twins import exact_transmittance, extended_composite
from labeller import reference
from labeller.curves import composite, error_curves, error_curves_by_g
from renderer.csr import bin_fragments, sort_fragments
from renderer.depth_bins import OPTICAL, bin_form, binned_exponents, kept_room
from renderer.tile_range import pixel_ranges
from schemas.colour import linear_to_srgb
from schemas.fragments import FragmentDump
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, DENSITY_G, MAX_EXPONENT, METRICS, TAILS, MetricName, TailName

_WHOLE: Final = 64  # of lists up to this long every k is compared, of longer ones a sample

_GS: Final = (0.0, 1e-3, 0.75, 1.5, 60.0)


@dataclass(frozen=True, slots=True)
class Entry:
    """One number of the reference: which, and what it is."""

    tail: TailName
    metric: MetricName
    pixel: int
    k: int
    error: float

    def __str__(self) -> str:
        return f"{self.tail}, {self.metric}, pixel {self.pixel}, k {self.k}"


def run(options: Options) -> Iterator[Finding]:
    """Curves and pictures of every case, all tails and metrics."""
    cases = curve_cases(options.quick, options.seed)
    for case in cases:
        yield curve_finding(case)
    yield worst_of([_weighted(case) for case in cases], f"{len(cases)} inputs, weights 1e-9 to 1e9")
    yield worst_of([_by_g(case) for case in cases], f"{len(cases)} inputs, g of {', '.join(f'{g:g}' for g in _GS)}")
    yield worst_of([picture_finding(case) for case in cases], f"{len(cases)} inputs, every tail")
    for tail in BINNED_TAILS:
        yield worst_of([_exponents(case, tail) for case in cases], f"{len(cases)} inputs, {tail}")
    yield from _reference(options)
    yield from _transmittance()
    yield from _sorting(options)


def curve_finding(case: Case) -> Finding:
    """Error curves of a case against the reference, over all tails and metrics."""
    entries, found = [], []
    for tail, metric in product(TAILS, METRICS):
        expected = list(reference_errors(case.dump, tail, metric))
        curves = error_curves(case.dump, tail, DENSITY_G, metric)
        entries += expected
        found += [float(curves.error[curves.offsets[x.pixel] + x.k]) for x in expected]
    truth = np.array([x.error for x in entries])
    return within("curves", case.name, np.array(found), truth, [str(x) for x in entries])


def _weighted(case: Case) -> Finding:
    """Curves with weights against the reference's errors times them, from 1e-9 to 1e9."""
    weights = np.geomspace(1e-9, 1e9, case.dump.pixels)
    entries = list(reference_errors(case.dump, DEFAULT_TAIL, "display"))
    curves = error_curves(case.dump, weights=weights)
    found = (
        np.array([curves.error[curves.offsets[x.pixel] + x.k] for x in entries]) / weights[[x.pixel for x in entries]]
    )
    return within("curves.weights", case.name, found, np.array([x.error for x in entries]), [str(x) for x in entries])


def _by_g(case: Case) -> Finding:
    """Curves of several steepnesses in one pass against those of one pass each, bit for bit."""
    wrong, where = 0, ""
    for g, curves in zip(_GS, error_curves_by_g(case.dump, _GS), strict=True):
        differ = int((curves.error != error_curves(case.dump, "density", g).error).sum())
        if differ:
            wrong, where = wrong + differ, f"g {g}"
    return counted("curves.by_g", case.name, wrong, where)


def _exponents(case: Case, tail: TailName) -> Finding:
    """Optical depths in front of fragments that depth bins tell, up to where weights end."""
    found, truth, names, ranges = [], [], [], pixel_ranges(case.dump)
    for p in np.flatnonzero(case.dump.counts).tolist():
        part = slice(case.dump.offsets[p], case.dump.offsets[p + 1])
        depth, rgba = case.dump.depth[part], case.dump.rgba[part]
        made, place = np.empty(len(depth)), (ranges.nearest[p], ranges.extent[p])
        binned_exponents(bin_form(TAILS[tail]), depth, rgba, *place, kept_room(), made)
        expected = reference.binned_exponents(reference.pixel_of(case.dump, p), OPTICAL[rgba[:, 3]], TAILS[tail])
        found += np.minimum(made, MAX_EXPONENT).tolist()
        truth += np.minimum(expected, MAX_EXPONENT).tolist()
        names += [f"{tail}, pixel {p}, fragment {i}" for i in range(len(depth))]
    return within("exponents", case.name, np.array(found), np.array(truth), names)


def reference_errors(dump: FragmentDump, tail: TailName, metric: MetricName, g: float = DENSITY_G) -> Iterator[Entry]:
    """The reference's curves; of long lists at some k only, for it takes O(n) for each."""
    for p in range(dump.pixels):
        pixel = reference.pixel_of(dump, p, stored=metric == "paper")
        ks = _some_k(pixel.n)
        colours = np.array(
            [reference.exact(pixel), *(reference.composite(pixel, k, tail, g) for k in ks if k < pixel.n)]
        )
        encoded = linear_to_srgb(colours) if metric == "display" else colours
        errors = [*((encoded[1:] - encoded[0]) ** 2).sum(axis=1), 0.0]
        yield from (Entry(tail, metric, p, k, float(e)) for k, e in zip(ks, errors, strict=True))


def picture_finding(case: Case) -> Finding:
    """Pictures of a case against the reference, over all tails, at several k."""
    dump, names, truth, found = case.dump, [], [], []
    n = dump.counts
    for tail, k in product(TAILS, (np.zeros_like(n), np.minimum(n, 1), n // 2, np.maximum(n - 1, 0), n)):
        picture = composite(dump, k, tail)
        for p in range(dump.pixels):
            truth.append(reference.composite(reference.pixel_of(dump, p), int(k[p]), tail))
            found.append(picture[p])
            names.append(f"{tail}, pixel {p}, k {k[p]}")
    return within("composite", case.name, np.array(found), np.array(truth), names)


def _some_k(n: int) -> list[int]:
    """Ascending, with n last."""
    if n <= _WHOLE:
        return list(range(n + 1))
    return sorted({0, 1, 2, 3, 7, n // 8, n // 3, n // 2, n - 2, n - 1, n})


def _reference(options: Options) -> Iterator[Finding]:
    """The float64 reference against extended precision."""
    if np.finfo(np.longdouble).nmant <= np.finfo(np.float64).nmant:
        return  # there is nothing longer here
    rows, cases = [], curve_cases(options.quick, options.seed)
    for case in cases:
        names, truth, found = [], [], []
        for tail, p in product(TAILS, range(min(case.dump.pixels, 8))):
            pixel = reference.pixel_of(case.dump, p)
            for k in sorted({0, min(1, pixel.n), pixel.n // 2, pixel.n}):
                truth.append(extended_composite(pixel, k, tail, DENSITY_G))
                found.append(reference.composite(pixel, k, tail))
                names.append(f"{tail}, pixel {p}, k {k}")
        # The difference is taken in extended precision: float64 would round it away.
        difference = np.array(found).astype(np.longdouble) - np.array(truth)
        rows.append(within("reference", case.name, difference, np.zeros(difference.shape), names))
    yield worst_of(rows, f"{len(cases)} inputs, every tail")


def _transmittance() -> Iterator[Finding]:
    """What comes through a list; beside it the product in float32, and the formula that METHOD section 2 rejects."""
    for name, level, n in (
        ("1/255", 1, LONGEST),
        ("1/255", 1, 256),
        (".5", 128, 24),
        (".5", 128, LONGEST),
        ("254/255", 254, 12),
    ):
        case, step = f"alpha {name}, n {n}", max(n // 64, 1)
        truth = np.array([float(exact_transmittance(level, i)) for i in range(0, n + 1, step)])
        places = [f"k {i}" for i in range(0, n + 1, step)]
        yield within("transmittance", case, _seen_through(level, range(0, n + 1, step)), truth, places)
        yield within("transmittance.float32", case, _through(level, n, np.float32)[::step], truth, places)
        for kind in (np.float32, np.float64):
            through = _through(level, n, kind)
            seen = (kind(level / 255.0) * through[:-1]).astype(kind)
            rejected = 1 - np.concatenate([np.zeros(1, kind), np.cumsum(seen, dtype=kind)])
            yield within("transmittance.rejected", f"{case}, {np.dtype(kind)}", rejected[::step], truth, places)


def _seen_through(level: int, counts: Sequence[int]) -> NDArray[np.float32]:
    """What the pictures of the labeller leave of white behind so many black fragments, for each count."""
    lists = [
        (np.tile(np.array([0, 0, 0, level], np.uint8), (n, 1)), np.arange(1, n + 1, dtype=np.float32)) for n in counts
    ]
    dump = dump_of(lists, (255, 255, 255))
    return composite(dump, dump.counts)[:, 0]


def _through(level: int, n: int, kind: type[np.float32 | np.float64]) -> NDArray[np.floating]:
    """The running product [n+1] of `1 - alpha`, rounded after every step."""
    factors = np.full(n, 1 - kind(level / 255.0), kind)
    return np.concatenate([np.ones(1, kind), np.cumprod(factors, dtype=kind)])


def _sorting(options: Options) -> Iterator[Finding]:
    """Lists in random order, counted and sorted into runs of pixels, by both sorts, against a stable sort of all."""
    rng = np.random.default_rng(options.seed)
    fragments = 20_000 if options.quick else 200_000
    for name, depth, colour, pixels in (
        ("random", rng.random(fragments) + 0.5, rng.integers(0, 2**32, fragments), 997),
        ("one depth in the whole image", np.full(fragments, 3.0), rng.integers(0, 2**32, fragments), 997),
        ("one depth, one colour", np.full(fragments, 3.0), np.full(fragments, 7), 31),
        ("denormal to huge depths", 10.0 ** rng.uniform(-44.0, 38.0, fragments), rng.integers(0, 4, fragments), 61),
    ):
        bits = depth.astype(np.float32).view(np.uint32).astype(np.uint64)
        keys = (bits << np.uint64(32)) | colour.astype(np.uint64)
        places = rng.integers(0, pixels, fragments, dtype=np.uint32)
        offsets, found_colour, found_depth, _ = bin_fragments(keys, places << np.uint32(8), pixels)
        expected = keys[np.lexsort((keys, places))]
        found = (found_depth.view(np.uint32).astype(np.uint64) << np.uint64(32)) | found_colour.astype(np.uint64)
        runs = keys[np.argsort(places, kind="stable")]
        sort_fragments(offsets, runs)
        wrong = np.flatnonzero((found != expected) | (runs != expected))
        yield counted("csr", f"{name}, N {fragments}", len(wrong), f"fragment {wrong[0]}" if len(wrong) else "")
