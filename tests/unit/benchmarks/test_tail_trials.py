"""Trials on tails of the benchmark of predictors: factors that a network answers, and small learned corrections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.dumps import random_dump
from support.training import random_weights

from benchmarks.predicting.factor_scores import answered, factor_cost
from benchmarks.predicting.factors import (
    ANSWER_BYTES,
    FACTORS,
    FactorHead,
    FactorView,
    errors_of,
    exponents_of,
    factor_labels,
    factor_view,
    interpolation,
    least_cost,
    start_of,
)
from benchmarks.predicting.learned_scores import learned_cost
from benchmarks.predicting.learned_tail import (
    INPUTS,
    UNITS,
    BinnedView,
    Corrections,
    Kind,
    Pixels,
    binned_view,
    corrected_errors,
    corrected_exponents,
    fitted,
    pixels_of,
)
from benchmarks.predicting.store import Store
from benchmarks.predicting.tail_kernels import errors_with
from benchmarks.predicting.variants import variants
from benchmarks.predicting.views import ViewRow, digest_of
from labeller.curves import error_curves
from labeller.hull import lower_hulls
from labeller.rules import allocate_curves
from renderer.features import FEATURES
from schemas.tail import DENSITY_BINS, TailName
from trainer.config import TrainConfig
from trainer.dataset import GROUP, Drawing, sample_batch
from trainer.heads import GainCurveHead, batch_loss
from trainer.models import Network

DUMP = random_dump(24, 16, 12, seed=5)
N = DUMP.total
TAILS: tuple[TailName, ...] = ("density", "density-8", "density-16")


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    made = Store(tmp_path_factory.mktemp("store"))
    arrays = {name: getattr(DUMP, name) for name in ("offsets", "rgba", "depth", "background", "facing")}
    np.savez(made.path("dumps", "box.npz"), size=np.array([DUMP.width, DUMP.height]), **arrays)
    return made


@pytest.fixture(scope="module")
def row() -> ViewRow:
    occupied = int(np.count_nonzero(DUMP.counts))
    return ViewRow("box", "box", "box.usda", "authored", "front", DUMP.pixels, N, occupied, digest_of(DUMP))


@pytest.fixture(scope="module")
def view(store: Store, row: ViewRow) -> FactorView:
    return factor_view(factor_labels(store, row, "density"), row.asset)


@pytest.mark.parametrize("tail", TAILS)
def test_the_factor_of_the_product_gives_its_errors(tail: TailName) -> None:
    usual = error_curves(DUMP, tail).error
    exponents = exponents_of(DUMP, tail)
    np.testing.assert_allclose(errors_of(DUMP, exponents, np.array(start_of(tail))), usual, rtol=1e-5, atol=1e-12)
    each = np.full(DUMP.pixels, start_of(tail))
    np.testing.assert_allclose(errors_of(DUMP, exponents, each), usual, rtol=1e-5, atol=1e-12)


def test_every_pixel_has_its_own_factor() -> None:
    factors = np.random.default_rng(1).uniform(0.0, 1.5, DUMP.pixels)
    mixed = errors_of(DUMP, exponents_of(DUMP, "density"), factors)
    offsets = DUMP.offsets + np.arange(DUMP.pixels + 1)
    for p in range(0, DUMP.pixels, 37):
        own = error_curves(DUMP, "density", g=float(factors[p])).error
        part = slice(offsets[p], offsets[p + 1])
        np.testing.assert_allclose(mixed[part], own[part], rtol=1e-5, atol=1e-12)


def test_labels_are_of_the_best_factor_of_each_count(store: Store, row: ViewRow) -> None:
    labels = factor_labels(store, row, "density")
    for factor in FACTORS:
        curves = error_curves(DUMP, "density", g=factor)
        for found, best in zip(allocate_curves(DUMP, curves, row.budgets, "optimal"), labels.optimum, strict=True):
            assert best <= found.error / (3 * DUMP.pixels) + 1e-9


def test_rows_have_the_hull_of_every_factor(view: FactorView) -> None:
    assert len(view.by_factor) == len(FACTORS)
    part = view.part(np.arange(5, 40, 3))
    for factor, whole, other in zip(FACTORS, view.by_factor, part.by_factor, strict=True):
        start = lower_hulls(error_curves(DUMP, "density", g=factor))
        for given_view in (whole, other):
            assert np.array_equal(given_view.n, (view if given_view is whole else part).n)
            gained = np.add.reduceat(
                np.append(given_view.slopes * given_view.lengths, np.float32(0.0)), given_view.offsets[:-1]
            )
            gained[np.diff(given_view.offsets) == 0] = 0.0
            # What all segments gain is the error of k = 0, and of some pixel of the view.
            assert np.isin(np.round(gained, 5), np.round(np.append(start.error, np.float32(0.0)), 5)).all()


@given(st.lists(st.floats(0.0, 2.0, width=32), min_size=1, max_size=9))
def test_interpolation_is_between_neighbours(factors: list[float]) -> None:
    shares = interpolation(torch.tensor(factors)).numpy()
    assert (shares >= 0.0).all()
    assert shares.sum(axis=1) == pytest.approx(np.ones(len(factors)), abs=1e-5)
    assert ((shares > 0.0).sum(axis=1) <= 2).all()
    assert shares @ np.array(FACTORS) == pytest.approx(np.minimum(factors, FACTORS[-1]), abs=1e-5)


@settings(max_examples=40)
@given(
    slopes=st.lists(st.floats(0.001, 8.0), min_size=1, max_size=5),
    price=st.floats(-3.0, 2.0),
    seed=st.integers(0, 99),
)
def test_the_least_cost_is_that_of_the_best_count(slopes: list[float], price: float, seed: int) -> None:
    falling = np.sort(np.array(slopes))[::-1]
    lengths = np.random.default_rng(seed).integers(1, 4, len(falling)).astype(float)
    ends = np.concatenate([[0], np.cumsum(lengths)]).astype(int)
    left = np.interp(np.arange(ends[-1] + 1), ends, np.append(np.cumsum((falling * lengths)[::-1])[::-1], 0.0))
    best = min(left[k] / np.exp(price) + k for k in range(ends[-1] + 1))
    one, other, at = (torch.tensor(np.array([x]), dtype=torch.float32) for x in (falling, lengths, price))
    assert float(least_cost(one, other, at)) == pytest.approx(best, rel=1e-4)


def test_one_factor_for_all_is_the_usual_regret_and_what_a_better_one_gains(view: FactorView) -> None:
    config, drawing = TrainConfig(batch=4 * GROUP, leak=0.0, view_weight=0.0), Drawing()
    head = FactorHead(0.75)
    network = head.network([view], config)
    with torch.no_grad():
        network.dense[-1].weight[2] = 0.0  # whatever the pixel: the factor that a network starts with
        usual = Network(network.features, network.mean.numpy(), network.std.numpy(), config.hidden)
        for own, same in zip(usual.dense, network.dense, strict=True):
            own.weight.copy_(same.weight[: len(own.weight)])
            own.bias.copy_(same.bias[: len(own.bias)])
        with_factor = float(head.loss(network, [view], config, 3, drawing))
        columns = [FEATURES.index(name) for name in network.features]
        at_start = replace(view.by_factor[FACTORS.index(0.75)])
        batch = sample_batch([at_start], columns, (config.seed, 3), config.batch, drawing)
        without = float(batch_loss(usual, batch, config))
    # The optimum that the regret is relative to has the best factor: no less is lost than under one factor alone.
    assert with_factor >= without - 1e-6
    assert with_factor > 0.0


def test_a_network_learns_its_factor(view: FactorView) -> None:
    config, head = TrainConfig(batch=8 * GROUP), FactorHead(0.75)
    network = head.network([view], config)
    optimiser = GainCurveHead().optimiser(network)
    losses = []
    for step in range(60):
        loss = head.loss(network, [view], config, step, Drawing())
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step(4e-3)
        losses.append(float(loss.detach()))
    assert np.mean(losses[-10:]) < 0.9 * np.mean(losses[:10])
    found = answered(network.weights(), DUMP, 0)
    assert np.ptp(found[DUMP.counts > 1, 2]) > 0.05, "pixels have factors of their own"
    assert (found[DUMP.counts == 0] == [0.0, 1.0, 0.0]).all()


def test_a_third_answer_takes_four_bytes_a_pixel() -> None:
    weights = random_weights(1, FEATURES, (8,), outputs=("a", "b", "g"))
    cost = factor_cost(weights, variants()["density, g from network"])
    two = random_weights(1, FEATURES, (8,))
    assert cost.weights == sum(w.size + b.size for w, b in two.layers) + 9
    plain = factor_cost(two, variants()["density-16, factor from network"])
    assert plain.capture_bytes - ANSWER_BYTES == 44


@pytest.fixture(scope="module")
def binned() -> BinnedView:
    return binned_view(DUMP, "density-16")


@pytest.fixture(scope="module")
def kept() -> NDArray[np.int64]:
    return np.asarray(np.minimum(DUMP.counts, np.random.default_rng(2).integers(0, 5, DUMP.pixels)), dtype=np.int64)


def nothing(kind: Kind) -> Corrections:
    """A network that corrects nothing."""
    shape = (UNITS, INPUTS[kind])
    hidden = np.ones(shape, np.float32), np.ones(UNITS, np.float32)
    return hidden, (np.zeros((1, UNITS), np.float32), np.zeros(1, np.float32))


@pytest.mark.parametrize("tail", [tail for tail in TAILS if tail in DENSITY_BINS])
def test_without_a_correction_a_tail_is_the_products(tail: TailName, kept: NDArray[np.int64]) -> None:
    view, usual = binned_view(DUMP, tail), error_curves(DUMP, tail)
    made = errors_with(DUMP, corrected_exponents(view, nothing("exponents")))
    np.testing.assert_allclose(made, usual.error, rtol=1e-4, atol=1e-9)
    for corrections in (None, nothing("coverage")):
        np.testing.assert_allclose(corrected_errors(view, kept, corrections), usual.at(kept), rtol=1e-4, atol=1e-9)


def test_inputs_are_finite_and_no_more_than_bins_know(binned: BinnedView) -> None:
    assert np.isfinite(binned.around).all()
    assert (binned.around >= 0.0).all()
    assert binned.around.shape == (N, INPUTS["exponents"])
    # Colours are no input: the same fragments in other colours have the same exponents.
    other = replace(DUMP, rgba=np.concatenate([255 - DUMP.rgba[:, :3], DUMP.rgba[:, 3:]], axis=1))
    assert np.array_equal(binned_view(other, "density-16").around, binned.around)


def test_a_correction_leaves_the_last_fragment_exact(binned: BinnedView) -> None:
    corrections = (nothing("coverage")[0], (np.zeros((1, UNITS), np.float32), np.full(1, 0.7, np.float32)))
    last = np.maximum(DUMP.counts - 1, 0)
    assert corrected_errors(binned, last, corrections).max() < 1e-20
    assert corrected_errors(binned, np.zeros_like(last), corrections).max() > 1e-3


def test_drawn_pixels_stand_for_the_view(binned: BinnedView, kept: NDArray[np.int64]) -> None:
    true = corrected_errors(binned, kept, None).sum() / (3 * DUMP.pixels)
    found = []
    for seed in range(8):
        pixels = pixels_of(binned, kept, seed)
        assert pixels is not None
        found.append(_mse(pixels))
    assert np.mean(found) == pytest.approx(true, rel=0.1)
    assert pixels_of(binned, DUMP.counts, 0) is None


@pytest.mark.parametrize("kind", ["exponents", "coverage"])
def test_a_fit_lowers_the_errors_that_it_is_fitted_to(kind: Kind, binned: BinnedView, kept: NDArray[np.int64]) -> None:
    pixels = pixels_of(binned, kept, 1)
    assert pixels is not None
    made = fitted(kind, [pixels], seed=3)
    before = corrected_errors(binned, kept, None).sum()
    if kind == "exponents":
        offsets = DUMP.offsets[:-1] + np.arange(DUMP.pixels)
        after = errors_with(DUMP, corrected_exponents(binned, made))[offsets + kept].sum()
    else:
        after = corrected_errors(binned, kept, made).sum()
    assert after < before
    again = fitted(kind, [pixels], seed=3)
    assert all(
        np.array_equal(x, y) for one, two in zip(made, again, strict=True) for x, y in zip(one, two, strict=True)
    )


def test_a_correction_costs_its_units() -> None:
    weights = random_weights(1, FEATURES, (8,))
    variant = variants()["density-16, learned exponents"]
    plain = learned_cost(weights, variant, ())
    cost = learned_cost(weights, variant, nothing("exponents"))
    assert cost.weights - plain.weights == (INPUTS["exponents"] + 2) * UNITS + 1
    assert cost.multiply_adds - plain.multiply_adds == (INPUTS["exponents"] + 1) * UNITS
    assert cost.capture_bytes == plain.capture_bytes


def _mse(pixels: Pixels) -> float:
    """Plain estimate of a view's mean squared error from its drawn pixels."""
    total = 0.0
    for r in range(len(pixels.share)):
        own = pixels.pixel == r
        weight = pixels.alpha[own] * np.exp(-pixels.exponent[own].astype(np.float64))
        mean = weight @ pixels.rgb[own] / weight.sum()
        tail = (1.0 - pixels.behind[r]) * mean + pixels.behind[r] * pixels.background[r]
        linear = np.clip(pixels.core[r] + pixels.through[r] * tail, 0.0, 1.0)
        shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        total += pixels.share[r] * np.square(shown - pixels.exact[r]).sum()
    return total
