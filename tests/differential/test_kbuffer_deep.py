"""`kbuffer-deep` in the frame against the same network, features and lambda on the CPU."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.training import export_random, random_weights

from labeller.curves import composite
from renderer.allocation.fill import feasible_k_min, solve_lambda
from renderer.features import FEATURES, derive, gather, texels_of
from renderer.frame import Frame
from renderer.techniques import Budget, KBufferDeep
from renderer.techniques.skips import PREDICTOR, SETTLED_PIXELS, TAIL, UNREAD_SUMS
from schemas.colour import display8
from schemas.fragments import FragmentDump
from trainer.weights import Weights


@pytest.fixture(scope="module", params=[FEATURES, ("log_n", "optical_depth", "rgb_nearest_g", "depth_std")])
def network(request: pytest.FixtureRequest) -> Weights:
    return random_weights(11, request.param)


@pytest.fixture(scope="module")
def bundle(
    network: Weights, dump: FragmentDump, gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    folder = tmp_path_factory.mktemp("bundle")
    export_random(folder, network, derive(gather(dump))[dump.counts > 0], gl)
    return folder


@pytest.fixture(scope="module")
def deep(bundle: Path) -> KBufferDeep:
    return KBufferDeep(bundle)


def test_gain_curves_equal_those_of_the_numpy_network(
    deep: KBufferDeep, network: Weights, frame: Frame, dump: FragmentDump
) -> None:
    pixels = np.flatnonzero(dump.counts > 1).astype(np.uint32)
    expected = np.stack(network.predict(derive(gather(dump))[pixels]), axis=1)
    # The spread features cancel in float32, so sums in another order show in the fourth digit of some pixels.
    difference = np.abs(deep.predict(frame, pixels) - expected) / np.maximum(1.0, np.abs(expected))
    assert np.quantile(difference, 0.99) < 1e-3
    assert difference.max() < 5e-2


@pytest.mark.parametrize("share", [0.05, 0.3, 0.7])
def test_budget_is_met_exactly_and_the_picture_is_as_simulated(
    deep: KBufferDeep, frame: Frame, dump: FragmentDump, share: float
) -> None:
    budget = Budget(int(share * dump.total))
    rendered = deep.render(frame, budget)
    assert rendered.captured == budget.fragments
    assert (rendered.k <= dump.counts).all()
    assert (rendered.k >= np.minimum(dump.counts, feasible_k_min(dump.counts, budget.fragments))).all()
    simulated = composite(dump, rendered.k, "density", 0.75).reshape(*rendered.linear.shape)
    assert np.abs(display8(rendered.linear).astype(int) - display8(simulated).astype(int)).max() <= 1


def test_counts_are_those_of_the_cpu(deep: KBufferDeep, network: Weights, frame: Frame, dump: FragmentDump) -> None:
    budget = dump.total // 3
    n = dump.counts
    k_min = feasible_k_min(n, budget)
    expected = np.minimum(n, k_min).astype(np.int32)
    rows = np.flatnonzero(n > k_min)
    a, b = network.predict(derive(gather(dump))[rows])
    left = budget - int(expected.sum()) + k_min * len(rows)
    expected[rows] = solve_lambda(a, b, n[rows], left, k_min)[0]
    difference = np.abs(deep.render(frame, Budget(budget)).k - expected)
    assert (difference == 0).mean() > 0.99
    assert difference.max() <= 1


def test_more_than_all_fragments_needs_no_network(deep: KBufferDeep, frame: Frame, dump: FragmentDump) -> None:
    rendered = deep.render(frame, Budget(2 * dump.total))
    assert np.array_equal(rendered.k, dump.counts)
    assert rendered.skips[PREDICTOR] == 1
    assert rendered.skips[TAIL] == 1
    assert not {"gather", "predict", "lambda"} & set(rendered.passes)


def test_onnx_and_glsl_give_the_same_picture(deep: KBufferDeep, bundle: Path, frame: Frame, dump: FragmentDump) -> None:
    other = KBufferDeep(bundle, "onnx")
    pixels = np.flatnonzero(dump.counts > 1).astype(np.uint32)
    np.testing.assert_allclose(other.predict(frame, pixels), deep.predict(frame, pixels), rtol=1e-5, atol=1e-5)
    budget = Budget(dump.total // 3)
    one, two = deep.render(frame, budget), other.render(frame, budget)
    assert (one.k == two.k).mean() > 0.999
    assert np.abs(display8(one.linear).astype(int) - display8(two.linear).astype(int)).max() <= 2


def test_features_are_read_in_blocks_as_at_once(
    deep: KBufferDeep, frame: Frame, dump: FragmentDump, monkeypatch: pytest.MonkeyPatch
) -> None:
    pixels = np.flatnonzero(dump.counts > 1).astype(np.uint32)
    features, gain = deep.features(frame, pixels), deep.predict(frame, pixels)
    monkeypatch.setattr("renderer.techniques.kbuffer_deep._DISPATCH", 1000)
    assert len(pixels) > 2000
    assert np.array_equal(deep.features(frame, pixels), features)
    assert np.array_equal(deep.predict(frame, pixels), gain)


def test_only_what_the_bundle_reads_is_gathered(
    deep: KBufferDeep, network: Weights, frame: Frame, dump: FragmentDump
) -> None:
    rendered = deep.render(frame, Budget(dump.total // 3))
    full = network.features == FEATURES
    assert rendered.skips[UNREAD_SUMS] == (0 if full else 2)
    gathered = frame.gather("gather", texels_of(network.features))
    assert gathered.pixel_bytes == (5 * 16 + 8 if full else 3 * 16 + 8)
    assert rendered.skips[SETTLED_PIXELS] == np.count_nonzero(dump.counts == 1)


@pytest.mark.parametrize("names", [("log_n", "alpha_mean", "depth_extent"), ("depth_extent",)])
def test_a_bundle_that_reads_no_nearest_fragment_does_not_gather_it(
    tmp_path: Path, frame: Frame, dump: FragmentDump, gl: moderngl.Context, names: tuple[str, ...]
) -> None:
    network = random_weights(4, names)
    export_random(tmp_path, network, derive(gather(dump))[dump.counts > 0], gl)
    deep = KBufferDeep(tmp_path)
    gathered = frame.gather("gather", texels_of(names))
    assert gathered.nearest_colour is None
    assert gathered.pixel_bytes == 16
    assert deep.render(frame, Budget(dump.total // 3)).skips[UNREAD_SUMS] == 5, "all but the first"
    pixels = np.flatnonzero(dump.counts > 1).astype(np.uint32)
    expected = np.stack(network.predict(derive(gather(dump))[pixels]), axis=1)
    np.testing.assert_allclose(deep.predict(frame, pixels), expected, rtol=1e-3, atol=1e-3)
