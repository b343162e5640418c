"""The benchmark of predictors: its tails against plain code, its costs, its folds, its feedback and its tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.dumps import random_dump
from support.training import random_weights

from benchmarks.labelling.plot import Labels, log_log
from benchmarks.predicting import tail_kernels
from benchmarks.predicting.cost import Cost, memory_of, network_cost, rule_cost
from benchmarks.predicting.feedback import DAMPING, MOST, corrected, observed
from benchmarks.predicting.inputs import changed
from benchmarks.predicting.page import proposals
from benchmarks.predicting.scoring import gain_counts, ratio
from benchmarks.predicting.store import CODE, Store, key_of
from benchmarks.predicting.summary import by_multiple, front
from benchmarks.predicting.tail_kernels import errors_with, exponents_with
from benchmarks.predicting.tails import trials
from benchmarks.predicting.training import folds_of
from benchmarks.predicting.variants import variants, without_texel
from labeller.curves import error_curves
from labeller.reference import pixel_of as plain_pixel
from labeller.reference import tail_weights
from renderer.depth_bins import OPTICAL
from renderer.features import FEATURES, derive, gather, texels_of
from renderer.reference.moment import share_before, warped
from schemas.tail import DENSITY_G, TAILS
from trainer.train import TrainConfig

DUMP = random_dump(24, 16, 12, seed=5)


def test_errors_are_those_of_the_labeller() -> None:
    exact = errors_with(DUMP, np.zeros(DUMP.total))
    assert np.allclose(exact, error_curves(DUMP, "exact-coverage").error, rtol=1e-5, atol=1e-10)
    weights = np.concatenate([tail_weights(plain_pixel(DUMP, p), "density-8") for p in range(DUMP.pixels)])
    exponents = -np.log(weights / (DUMP.rgba[:, 3] / 255.0))
    assert np.allclose(errors_with(DUMP, exponents), error_curves(DUMP, "density-8").error, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("root", [0.0, 0.6])
@pytest.mark.parametrize("levels", [0, 15, 255])
def test_bins_of_any_kind(root: float, levels: int) -> None:
    bins = 8
    found = exponents_with(DUMP, tail_kernels.bin_exponents, bins, root, levels)
    for p in range(DUMP.pixels):
        part = slice(DUMP.offsets[p], DUMP.offsets[p + 1])
        if part.start == part.stop:
            continue
        z = DUMP.depth[part]
        optical = -np.log(np.maximum(1.0 - DUMP.rgba[part, 3] / 255.0, 1e-3))
        x = (z - z[0]) / (z[-1] - z[0]) if z[-1] > z[0] else np.zeros_like(z)
        y = (np.float32(1.0 - root) * x + np.float32(root) * np.sqrt(x)) * np.float32(bins)
        place = np.minimum(y.astype(int), bins - 1)
        share = np.array([optical[place < b].sum() for b in range(bins + 1)]) / optical.sum()
        if levels:
            near_tie = np.abs((share * levels) % 1.0 - 0.5) < 1e-9
            if near_tie.any():
                continue
            share = np.round(share * levels) / levels
        before = share * optical.sum()
        inside = np.maximum(before[place + 1] - before[place] - optical, 0.0) * (y - place)
        assert np.allclose(found[part], before[place] + inside, rtol=1e-6, atol=1e-6)


def test_power_moments_are_those_of_the_technique() -> None:
    found = exponents_with(DUMP, tail_kernels.moment_exponents)
    for p in range(DUMP.pixels):
        part = slice(DUMP.offsets[p], DUMP.offsets[p + 1])
        if part.stop - part.start < 3:
            continue
        optical = -np.log(np.maximum(1.0 - DUMP.rgba[part, 3] / 255.0, 1e-3))
        depth = optical.sum() * share_before(optical, warped(DUMP.depth[part]))
        # The reference inverts a matrix whose condition is the inverse of the bias.
        assert np.allclose(found[part], depth - depth.min(), atol=1e-3 * (1.0 + optical.sum()))


def test_the_power_fits_the_mean_depth() -> None:
    found = exponents_with(DUMP, tail_kernels.power_exponents)
    for p in range(DUMP.pixels):
        part = slice(DUMP.offsets[p], DUMP.offsets[p + 1])
        z, n = DUMP.depth[part].astype(np.float64), part.stop - part.start
        if n < 3 or z[-1] == z[0]:
            continue
        optical, x = OPTICAL[DUMP.rgba[part, 3]], (z - z[0]) / (z[-1] - z[0])
        for i in range(n):
            others = np.delete(np.arange(n), i)
            mean = np.clip(np.average(x[others], weights=optical[others]), 0.02, 0.98)
            assert found[part][i] == pytest.approx(optical[others].sum() * x[i] ** (mean / (1.0 - mean)), abs=1e-9)


def test_tails_that_were_tried_are_exact_with_every_fragment() -> None:
    last = DUMP.offsets[1:] + np.arange(DUMP.pixels)
    names = [trial.name for trial in trials()]
    assert len(names) == len(set(names)) > 10
    for trial in trials():
        errors = trial.errors(DUMP)
        assert errors.dtype == np.float32
        assert np.isfinite(errors).all()
        assert (errors >= 0.0).all()
        assert (errors[last] == 0.0).all()


def test_the_best_g_is_no_worse_than_any() -> None:
    best = next(trial for trial in trials() if "best g" in trial.name).errors(DUMP)
    assert (best <= error_curves(DUMP, "density", DENSITY_G).error).all()


def test_variants_differ_from_their_base_and_name_it() -> None:
    every = variants()
    for variant in every.values():
        assert variant.base == "" or variant.base in every
        assert set(variant.config.features) <= set(FEATURES)
        assert variant.tail in TAILS
        if variant.teacher:
            assert (every[variant.teacher].taught, every[variant.teacher].inputs) == (variant.taught, variant.inputs)
            assert 0.0 < variant.teaching <= 1.0
    tried = [variant for variant in every.values() if variant.part != "bundles"]  # what is shipped may be the default
    said = [replace(variant, name="", part="variants", base="") for variant in tried]
    assert len(set(said)) == len(said)


@pytest.mark.parametrize("texel", range(6))
def test_without_a_texel_it_is_not_gathered(texel: int) -> None:
    kept = without_texel(texel)
    assert texel not in texels_of(kept, binned=True)
    assert texels_of(kept, binned=True) < texels_of(FEATURES, binned=True)
    # Nothing else is left out.
    assert all(texel in texels_of([name], binned=True) for name in set(FEATURES) - set(kept))


def test_costs_count_what_is_gathered() -> None:
    lean = network_cost(random_weights(1, ("log_n", "optical_depth"), (8,)), "density-8")
    assert (lean.weights, lean.multiply_adds) == (2 * 8 + 8 + 8 * 2 + 2, 2 * 8 + 8 * 2)
    full = network_cost(random_weights(1, FEATURES, (8,)), "density-8")
    # Bins are packed before sums are gathered: what counts is the larger of the two.
    assert lean.feature_bytes == 8 + 2 * 8 + 4
    assert full.feature_bytes == 8 + 5 * 8 + 4
    assert full.capture_bytes == lean.capture_bytes
    assert rule_cost("density", nearest=False).capture_bytes == 64
    assert rule_cost("density", nearest=True).gather_bytes == rule_cost("density", nearest=False).gather_bytes + 8
    assert rule_cost("density-8", nearest=True).gather_bytes == 12 + 8 + 2 * 8 + 4, "the nearest comes after the bins"


@given(
    gathered=st.integers(0, 120),
    captured=st.integers(20, 90),
    multiple=st.sampled_from([1, 2, 4]),
    pixels=st.just(1000),
)
def test_a_budget_fills_the_memory_and_no_more(gathered: int, captured: int, multiple: int, pixels: int) -> None:
    cost = Cost(0, 0, 0, gathered, captured)
    total = memory_of(multiple, pixels)
    budget = cost.budget(total, pixels)
    if budget is None:
        assert max(gathered, captured) * pixels > total
    else:
        alive = [8 * slots + max(captured * pixels, gathered * pixels - 8 * slots) for slots in (budget, budget + 1)]
        assert alive[0] <= total < alive[1]


def test_the_reference_of_memory_is_fixed_k() -> None:
    assert rule_cost("density", nearest=False).budget(memory_of(2, 500), 500) == 1000


@given(st.lists(st.text("abcdef", min_size=1), unique=True, min_size=2), st.integers(2, 6), st.randoms())
def test_folds_do_not_depend_on_the_order(names: list[str], folds: int, random: object) -> None:
    shuffled = list(names)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    found = folds_of(names, folds)
    assert found == folds_of([*shuffled, names[0]], folds)
    sizes = np.bincount(list(found.values()))
    assert len(sizes) == min(folds, len(names))
    assert sizes.max() - sizes.min() <= 1


def test_counts_spend_the_budget() -> None:
    n = DUMP.counts.astype(np.int32)
    rng = np.random.default_rng(3)
    a, b = rng.normal(-6.0, 2.0, DUMP.pixels), rng.uniform(0.1, 2.0, DUMP.pixels)
    occupied = int(np.count_nonzero(n))
    for budget in (0, occupied // 2, occupied, 2 * occupied, DUMP.total, DUMP.total + 5):
        k = gain_counts(a, b, n, budget)
        assert k.sum() == min(budget, DUMP.total)
        assert ((k >= 0) & (k <= n)).all()


def test_feedback_moves_curves_towards_what_was_seen() -> None:
    a, b, k = np.array([-5.0, -5.0, -5.0, -5.0]), np.full(4, 0.5), np.array([3, 3, 0, 3], np.int32)
    seen = np.exp(np.array([-6.0, -7.0, 9.0, 30.0]))  # as predicted, less, unseen, far more
    assert corrected(a, b, k, seen) == pytest.approx([-5.0, -5.0 - DAMPING, -5.0, -5.0 + DAMPING * MOST])


def test_what_feedback_sees_of_the_last_fragment() -> None:
    curves = error_curves(DUMP, "density-8")
    full = DUMP.counts.astype(np.int32)
    gains = observed("error", DUMP, curves, full)
    # With everything kept, the colour with the last fragment is the exact one.
    assert np.allclose(observed("colour", DUMP, curves, full), gains, atol=1e-5)
    assert (observed("colour", DUMP, curves, np.zeros_like(full)) == 0.0).all()


def test_changed_inputs() -> None:
    features = derive(gather(DUMP, 8))
    assert changed(features, "plain", DUMP.width) is features
    around = changed(features, "neighbourhood", DUMP.width)
    log_n = features[:, 0].reshape(DUMP.height, DUMP.width)
    assert around[:, FEATURES.index("front_1")].reshape(log_n.shape)[5, 7] == pytest.approx(log_n[4:7, 6:9].mean())
    untouched = [i for i, name in enumerate(FEATURES) if name not in ("front_1", "front_3")]
    assert np.array_equal(around[:, untouched], features[:, untouched])
    seen = features[:, 0] > 0.0
    relative = changed(features, "view-normalised", DUMP.width)[seen]
    assert relative.mean(axis=0) == pytest.approx(np.zeros(len(FEATURES)), abs=1e-3)
    assert relative[:, 0].std() == pytest.approx(1.0, abs=1e-3)
    assert len(np.unique(changed(features, "view-means", DUMP.width)[:, FEATURES.index("front_1")])) == 1


def test_results_are_remembered_by_key(tmp_path: Path) -> None:
    store, made = Store(tmp_path), []

    def make() -> dict[str, float]:
        made.append(1)
        return {"x": 0.5}

    assert store.remember("a", key_of("one"), make) == store.remember("a", key_of("one"), make) == {"x": 0.5}
    assert len(made) == 1
    store.remember("a", key_of("two"), make)
    assert len(made) == 2
    assert all(len(store.code(kind)) == 64 for kind in CODE)


def test_a_result_that_was_not_finished_is_not_there(tmp_path: Path) -> None:
    store = Store(tmp_path)

    def fail(path: Path) -> None:
        path.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        store.write(store.path("a", "b.json"), fail)
    assert not store.path("a", "b.json").exists()


def test_means_are_over_views_that_have_the_budget() -> None:
    rows = [
        {"multiples": [1, 2], "q": [0.1, 4.0], "at memory": [0.5, None]},
        {"multiples": [1], "q": [0.4], "at memory": [0.5]},
    ]
    assert by_multiple(rows, "q") == [pytest.approx(0.2), pytest.approx(4.0), None]
    assert by_multiple(rows, "at memory") == [pytest.approx(0.5), None, None]
    assert ratio(0.0, 0.0) == 1.0


@given(st.dictionaries(st.text(min_size=1), st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1))
def test_the_front_is_what_nothing_beats(points: dict[str, tuple[int, int]]) -> None:
    kept = front(points)
    assert kept
    for name, point in points.items():
        beaten = any(o[0] <= point[0] and o[1] <= point[1] and o != point for o in points.values())
        assert (name in kept) != beaten


def test_sizes_are_the_cheapest_that_come_near() -> None:
    rows = {
        name: {"q": [q] * 3, "cost": {"multiply_adds": adds, "gather_bytes": held}}
        for name, q, adds, held in (
            *(("best", 0.1, 900, 100), ("near", 0.108, 300, 50), ("large", 0.109, 200, 100)),
            *(("far", 0.125, 20, 50), ("poor", 0.3, 1, 1)),
        )
    }
    assert proposals(rows) == {"full": "best", "small": "near", "tiny": "far"}


def test_points_of_some_series_are_not_joined() -> None:
    series = {"front": [(1.0, 1.0), (2.0, 0.5)], "others": [(1.5, 2.0), (3.0, 3.0)]}
    drawn = log_log(Labels("t", "x", "y"), series, proportional=False, apart=["others"])
    assert drawn.count("<polyline") == 1
    assert drawn.count("<circle") == 4 + 2


def test_a_variant_changes_its_key_only_with_its_training() -> None:
    default = TrainConfig()
    assert replace(variants()["density-16"], name="x").config.decisive == default.decisive
    assert variants()["seed 1"].config.decisive != default.decisive
