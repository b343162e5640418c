"""`kbuffer-deep` in the frame against the same network, features and lambda on the CPU."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from support.scenes import SIZE, VIEW, shells
from support.training import export_random, random_weights

from labeller.curves import composite
from renderer.allocation.fill import budget_fill, solve_lambda
from renderer.allocation.lattice import curves_of, price, solve_on_lattice
from renderer.features import FEATURES, derive, gather, texels_of
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, KBufferDeep
from renderer.techniques.skips import PREDICTOR, TAIL, UNREAD_SUMS
from schemas.bundle import HeadName, OutputName
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
    budget = Budget(int(share * dump.total), "density")
    rendered = deep.render(frame, budget)
    assert rendered.captured == budget.fragments
    assert (rendered.k <= dump.counts).all()
    assert (rendered.k >= 0).all()
    simulated = composite(dump, rendered.k, "density", 0.75).reshape(*rendered.linear.shape)
    assert np.abs(display8(rendered.linear).astype(int) - display8(simulated).astype(int)).max() <= 1


def test_counts_are_those_of_the_cpu(deep: KBufferDeep, network: Weights, frame: Frame, dump: FragmentDump) -> None:
    budget = dump.total // 3
    n = dump.counts
    expected = np.zeros(len(n), dtype=np.int32)
    rows = np.flatnonzero(n)
    a, b = network.predict(derive(gather(dump))[rows])
    expected[rows] = solve_lambda(a, b, n[rows], budget)[0]
    difference = np.abs(deep.render(frame, Budget(budget)).k - expected)
    assert (difference == 0).mean() > 0.99
    assert difference.max() <= 1


@pytest.fixture
def fresh(gl: moderngl.Context) -> Frame:
    """A frame of which nothing is known yet."""
    return Frame(GpuScene(gl, shells()), VIEW, *SIZE)


def test_more_than_all_fragments_needs_no_network(deep: KBufferDeep, fresh: Frame, dump: FragmentDump) -> None:
    fresh.count()
    rendered = deep.render(fresh, Budget(2 * dump.total))
    assert np.array_equal(rendered.k, dump.counts)
    assert (rendered.skips[PREDICTOR], rendered.skips[TAIL]) == (1, 1)
    assert not {"gather", "predict", "lambda"} & set(rendered.passes)


@pytest.mark.parametrize("more", [0, 1000])
def test_all_fragments_are_the_exact_picture_where_their_number_is_not_known(
    deep: KBufferDeep, fresh: Frame, dump: FragmentDump, more: int
) -> None:
    rendered = deep.render(fresh, Budget(dump.total + more))
    assert not fresh.counted
    assert np.array_equal(rendered.k, dump.counts)
    assert (rendered.skips[PREDICTOR], rendered.skips[TAIL]) == (1, 0)
    fresh.count()
    assert np.array_equal(deep.render(fresh, Budget(dump.total)).linear, rendered.linear)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.9])
def test_nothing_is_read_back_before_the_picture(
    deep: KBufferDeep, fresh: Frame, dump: FragmentDump, share: float, unread_until_pictured: list[bool]
) -> None:
    rendered = deep.render(fresh, Budget(int(share * dump.total), "density"))
    assert rendered.captured == int(share * dump.total)
    assert len(unread_until_pictured) == 1


def test_another_budget_of_a_frame_needs_no_inference(bundle: Path, fresh: Frame, dump: FragmentDump) -> None:
    deep, alone = KBufferDeep(bundle, keeps_curves=True), KBufferDeep(bundle)
    first = deep.render(fresh, Budget(dump.total // 2))
    again = deep.render(fresh, Budget(dump.total // 3))
    assert again.passes["predict"] == first.passes["predict"]
    assert again.passes["gather"] == first.passes["gather"]
    other = alone.render(fresh, Budget(dump.total // 3))
    assert other.passes["predict"] != first.passes["predict"], "another technique has its own predictions"
    assert np.array_equal(again.k, other.k)
    assert np.array_equal(again.linear, other.linear)


def test_both_solvers_give_the_same_counts_but_for_what_grows_between_two_prices(
    bundle: Path, fresh: Frame, dump: FragmentDump
) -> None:
    occupied = np.flatnonzero(dump.counts).astype(np.uint32)
    a, b = KBufferDeep(bundle).predict(fresh, occupied).T
    for budget in (dump.total // 5, dump.total // 2):
        on_gpu, on_cpu = (KBufferDeep(bundle, solver=solver).render(fresh, Budget(budget)) for solver in ("gpu", "cpu"))
        assert on_gpu.captured == on_cpu.captured == budget
        assert (on_gpu.k == on_cpu.k).mean() > 0.99
        assert np.abs(on_gpu.k - on_cpu.k).max() <= 1
        index = solve_on_lattice(curves_of(a, b), dump.counts[occupied], budget).index
        assert index is not None
        t, following = float(price(index)), float(price(index + 1))
        came_at = (np.maximum(on_gpu.k, on_cpu.k)[occupied] - 1.5) * b - a
        differ = (on_gpu.k != on_cpu.k)[occupied]
        assert (np.abs(came_at[differ] - t) <= 2.0 * (following - t) + 1e-5).all()


def test_what_onnxruntime_predicts_is_not_solved_on_the_gpu(bundle: Path) -> None:
    with pytest.raises(ValueError, match="GLSL"):
        KBufferDeep(bundle, "onnx", "gpu")


@pytest.mark.parametrize(
    ("head", "outputs"), [("importance", ("importance",)), ("gain-curve", ("a", "b", "g"))], ids=["importance", "abg"]
)
def test_bundles_of_other_outputs_meet_the_budget_as_their_networks_say(
    tmp_path: Path,
    fresh: Frame,
    dump: FragmentDump,
    gl: moderngl.Context,
    head: HeadName,
    outputs: tuple[OutputName, ...],
) -> None:
    network = random_weights(5, ("log_n", "alpha_mean"), (8,), head, outputs)
    features = derive(gather(dump))
    export_random(tmp_path, network, features[dump.counts > 0], gl)
    deep = KBufferDeep(tmp_path)
    pixels = np.flatnonzero(dump.counts).astype(np.uint32)
    expected = network.run(features[pixels])
    np.testing.assert_allclose(deep.predict(fresh, pixels), expected, rtol=1e-3, atol=1e-3)
    n, budget = dump.counts[pixels], dump.total // 3
    chosen = budget_fill(expected[:, 0], n, budget) if head == "importance" else None
    if chosen is None:
        chosen, _ = solve_lambda(expected[:, 0], expected[:, 1], n, budget)
    rendered = deep.render(fresh, Budget(budget))
    assert rendered.captured == budget
    assert (rendered.k[pixels] == chosen).mean() > 0.99


def test_features_are_given_back_before_fragments_are_captured(
    deep: KBufferDeep, network: Weights, fresh: Frame, dump: FragmentDump
) -> None:
    gathered = fresh.gather("gather", texels_of(network.features)).pixel_bytes
    # n, depth range, curves and all sums, then the list beside the first sums; then offsets instead of curves and list,
    # the first sums and the tail's targets, with the pool.
    before, after = 12 + 8 + max(gathered, 16 + 4), 12 + 4 + 16 + 32
    few = deep.render(fresh, Budget(dump.total // 10, "density"))
    assert (few.early_bytes, few.pixel_bytes) == (before, after)
    assert few.total_bytes == max(before * fresh.pixels, after * fresh.pixels + few.pool_bytes)
    many = deep.render(fresh, Budget(dump.total - 1, "density"))
    assert many.total_bytes == max(before * fresh.pixels, after * fresh.pixels + many.pool_bytes)


def test_onnx_and_glsl_give_the_same_picture(deep: KBufferDeep, bundle: Path, frame: Frame, dump: FragmentDump) -> None:
    other = KBufferDeep(bundle, "onnx")
    pixels = np.flatnonzero(dump.counts > 1).astype(np.uint32)
    np.testing.assert_allclose(other.predict(frame, pixels), deep.predict(frame, pixels), rtol=1e-5, atol=1e-5)
    budget = Budget(dump.total // 3)
    one, two = deep.render(frame, budget), other.render(frame, budget)
    same = one.k == two.k
    assert same.mean() > 0.999
    difference = np.abs(display8(one.linear).astype(int) - display8(two.linear).astype(int)).reshape(-1, 3)
    assert difference[same].max() <= 1


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
    assert gathered.pixel_bytes == (5 * 16 + 4 if full else 3 * 16 + 4)


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
