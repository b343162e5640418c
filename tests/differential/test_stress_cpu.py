"""The CPU part of `diaphane stress`, quick: every fast path is within its bound."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from evaluation.stress import curves, features, fills
from evaluation.stress.bounds import BOUNDS
from evaluation.stress.cases import bin_cases, curve_cases, dump_of, some_list
from evaluation.stress.findings import Finding, Options, Row
from evaluation.stress.suites import Listed, rows_of
from evaluation.stress.twins import features64, network64, sums64
from labeller.curves import error_curves
from renderer.allocation.cuts import Cuts
from renderer.depth_bins import bin_form, keep_bins, kept_room, place_of
from renderer.features import FEATURES, SUMS, derive, gather
from schemas.tail import BIN_LIMIT, BINNED_TAILS, MOST_BINS, TAILS

QUICK = Options(quick=True)


@cache
def rows(name: str) -> list[Row]:
    return list(rows_of(Listed(name, ()), QUICK))


def findings(name: str) -> list[Finding]:
    return [row for row in rows(name) if isinstance(row, Finding)]


def refused(found: Sequence[Row]) -> list[Row]:
    return [row for row in found if not (isinstance(row, Finding) and row.ok)]


@pytest.mark.parametrize(
    ("name", "paths"),
    [
        (
            "curves",
            {"curves", "curves.weights", "curves.by_g", "exponents", "composite", "reference", "transmittance", "csr"}
            | {"transmittance.float32", "transmittance.rejected"},
        ),
        ("fills", {"fill.limits", "fill.budget", "fill.cuts", "fill.order", "sum", "sum.rejected"}),
        ("features", {f"features.{name}" for name in ("gather", "derive", "spread", "kept")}),
    ],
)
def test_every_path_of_a_suite_is_within_its_bound(name: str, paths: set[str]) -> None:
    found = rows(name)
    assert refused(found) == []
    assert {row.path for row in found} == paths
    assert all(row.bound == BOUNDS[row.path].value for row in found if isinstance(row, Finding))


def test_the_cases_are_what_method_section_6_names() -> None:
    cases = {case.name: case.dump for case in curve_cases(False, 0)}
    alphas = {int(a) for dump in cases.values() for a in np.unique(dump.rgba[:, 3])}
    assert {0, 1, 128, 254, 255} <= alphas
    counts = np.concatenate([dump.counts for dump in cases.values()])
    assert set(range(41)) | {4096} <= set(counts.tolist())
    depth = np.concatenate([dump.depth for dump in cases.values()])
    assert depth.min() < 1.2e-38
    assert depth.max() > 1e38
    assert len(np.unique(cases["depth ties across an image"].depth)) == 1
    far = cases["near/far 1e7, n 32"].depth
    assert far.max() / far.min() > 1e6
    for dump in cases.values():
        keys = np.lexsort((dump.rgba.view("<u4")[:, 0], dump.depth, np.repeat(np.arange(dump.pixels), dump.counts)))
        assert (keys == np.arange(dump.total)).all(), "front to back, ties by colour"


def test_hard_lists_of_depth_bins_are_what_their_names_say() -> None:
    edges, ties, full = (case.dump for case in bin_cases())
    for bins in (8, MOST_BINS):  # those of 12 are at other places, but for every third
        depth = edges.depth[:85]
        place = [float(place_of(z, depth[0], depth[-1] - depth[0], bins)) for z in depth]
        inner = [sum(abs(y - b) < 1e-4 for y in place) for b in range(1, bins)]
        assert min(inner) >= 4, "1 ulp before, at and behind every edge"
        assert {int(y) for y in place} == set(range(bins + 1))
    shares = gather(ties, "density-16")[:, SUMS.index("front_8")] * TAILS["density-16"].share_levels
    ahead = np.arange(1, 30, 2)
    np.testing.assert_array_equal(np.rint(shares), (ahead + 1) // 2)  # of `ahead` thirtieths, up
    form, depth = bin_form(TAILS["binned-8"]), full.depth[:64]
    assert keep_bins(form, depth, full.rgba[:64], depth[0], np.float32(1.0), kept_room()) == BIN_LIMIT


@pytest.mark.parametrize(
    ("name", "broken", "path"),
    [
        ("gather", lambda dump, tail: gather(dump, tail) * np.float32(1.2), "features.kept"),
        ("binned_exponents", lambda *arguments: arguments[-1].fill(0.5), "exponents"),
    ],
)
def test_other_accounts_of_depth_bins_are_violations__name(
    monkeypatch: pytest.MonkeyPatch, name: str, broken: Callable[..., object], path: str
) -> None:
    module = features if path == "features.kept" else curves
    monkeypatch.setattr(module, name, broken)
    case = bin_cases()[0]
    found = [
        features._kept(case, tail) if path == "features.kept" else curves._exponents(case, tail)
        for tail in BINNED_TAILS
    ]
    assert [(row.path, row.ok) for row in found] == [(path, False)] * len(BINNED_TAILS)
    assert "pixel" in found[0].where


def test_cuts_that_leave_bins_out_or_take_too_many_are_violations(monkeypatch: pytest.MonkeyPatch) -> None:
    solve = fills.solve_cuts

    def violated(change: Callable[[Cuts], Cuts]) -> set[str]:
        monkeypatch.setattr(fills, "solve_cuts", lambda events, budget: change(solve(events, budget)))
        return {row.path for row in fills._whole_bins(np.random.default_rng(0), 300) if not row.ok}

    assert violated(lambda cuts: cuts) == set()
    assert violated(lambda cuts: replace(cuts, k=cuts.k + 1)) == {"fill.limits"}
    assert violated(lambda cuts: replace(cuts, k=0 * cuts.k, cut=0 * cuts.cut)) == {"fill.limits"}
    assert "fill.cuts" in violated(lambda cuts: replace(cuts, cut=np.where(cuts.cut > 1, 1, cuts.cut)))


def test_the_rejected_formula_is_as_bad_as_told_and_the_one_in_use_is_not() -> None:
    found = {(row.path, row.case): row for row in findings("curves")}
    good = found["transmittance", "alpha 1/255, n 4096"]
    short = found["transmittance.float32", "alpha 1/255, n 4096"]
    bad = found["transmittance.rejected", "alpha 1/255, n 4096, float32"]
    assert good.relative < 1e-7
    assert short.relative < 1e-5
    assert bad.relative > 1.0
    assert not bad.judged
    assert good.judged


def test_one_float32_accumulator_loses_what_the_sum_in_use_keeps() -> None:
    sums = findings("fills")
    assert max(row.relative for row in sums if row.path == "sum") < 1e-12
    assert max(row.relative for row in sums if row.path == "sum.rejected") > 1e-4


def test_the_twins_are_what_the_definitions_say() -> None:
    rgba = np.array([[255, 0, 0, 51], [0, 255, 0, 102]], np.uint8)
    dump = dump_of([(rgba, np.array([2.0, 4.0], np.float32))], (0, 0, 255))
    found = dict(zip(FEATURES, features64(sums64(dump, "binned-8"))[0], strict=True))
    light = -np.log([0.8, 0.6])
    share = light / light.sum()
    assert found["log_n"] == 1.0
    assert found["optical_depth"] == pytest.approx(np.log1p(light.sum()), abs=2e-3)  # D in units of 1 / 253
    assert found["depth_extent"] == pytest.approx(np.log(1e-4 + 0.5))
    luma = np.array([0.2126, 0.7152])  # of red, of green: weights of BT.709, in 256ths
    assert found["luma_mean"] == pytest.approx((share * luma).sum(), abs=3e-3)
    spread = (share * luma**2).sum() - (share * luma).sum() ** 2
    assert found["luma_std"] == pytest.approx(np.sqrt(spread), abs=3e-3)
    assert found["background_b"] == 1.0
    assert {found[f"front_{b}"] for b in range(1, 8)} == {round(255 * 212 / (212 + 486)) / 255}  # D in units
    assert {found[f"mean_{b}"] for b in range(1, 8)} == {0.0}
    assert {found[f"front_{b}"] for b in range(8, 16)} == {0.0}
    layers = [(np.array([[2.0], [0.0]], np.float32), np.array([1.0, 0.0], np.float32))]
    a, b = network64(np.zeros(1, np.float32), np.ones(1, np.float32), layers, np.array([[3.0]], np.float32))[0]
    assert (a, b) == pytest.approx((7.0, np.log(2.0)))


def test_spreads_of_equal_fragments_end_at_their_least() -> None:
    (case,) = (case for case in curve_cases(True, 0) if case.name == "found: 89 equal fragments")
    found = derive(gather(case.dump, features.EVERY))[:, features.SPREADS]
    np.testing.assert_array_equal(found, np.sqrt(np.float32(1e-3)))


@pytest.mark.parametrize("n", [1, 4096])
def test_features_of_long_lists_stay_finite(n: int) -> None:
    dump = dump_of([some_list(np.random.default_rng(n), n, 1)])
    assert np.isfinite(derive(gather(dump, features.EVERY))).all()
    assert np.isfinite(error_curves(dump).error).all()
