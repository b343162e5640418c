"""`kbuffer-deep` in the frame against the same network, features and cuts on the CPU, and the simulated picture."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray
from support.ranks import expected_k, ranks_and_counts
from support.scenes import SIZE, VIEW, shells
from support.training import export_random, random_weights

from labeller.curves import composite
from renderer.allocation.cuts import usable_counts
from renderer.allocation.prices import feature_prior, gain_prices, ranks_of
from renderer.depth_bins import bin_counts
from renderer.features import FEATURES, derive, gather
from renderer.frame import Frame
from renderer.gpu_scene import GpuScene
from renderer.techniques import Budget, KBufferDeep, Rendered
from renderer.techniques.skips import PREDICTOR, UNREAD_LUMA
from schemas.colour import display8
from schemas.fragments import FragmentDump
from schemas.problem import ExitCode, Problem
from schemas.tail import BINNED_TAILS, DEFAULT_TAIL, TAIL_NAMES, TAILS, TailName
from trainer.weights import Weights

FEW = ("log_n", "optical_depth", "front_3", "mean_2", "depth_extent")
"""Features that read no colours."""
SHARES = [0.02, 0.3, 0.9]


@pytest.fixture(scope="module", params=[FEATURES, FEW], ids=["all features", "no colours"])
def network(request: pytest.FixtureRequest) -> Weights:
    return random_weights(11, request.param)


@pytest.fixture(scope="module")
def features(dump: FragmentDump) -> NDArray[np.float32]:
    return derive(gather(dump, DEFAULT_TAIL))


@pytest.fixture(scope="module")
def bundle(
    network: Weights,
    dump: FragmentDump,
    features: NDArray[np.float32],
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    folder = tmp_path_factory.mktemp("bundle")
    export_random(folder, network, features[dump.counts > 0])
    return folder


@pytest.fixture(scope="module")
def deep(bundle: Path) -> KBufferDeep:
    return KBufferDeep(bundle)


@pytest.fixture
def fresh(gl: moderngl.Context) -> Frame:
    """A frame of which nothing is known yet."""
    return Frame(GpuScene(gl, shells()), VIEW, *SIZE, float_sums=True)


def counted(frame: Frame, tail: TailName = DEFAULT_TAIL) -> NDArray[np.uint8]:
    return frame.kept_bins(tail).counts()


def assert_as_simulated(rendered: Rendered, dump: FragmentDump, tail: TailName = DEFAULT_TAIL) -> None:
    simulated = composite(dump, rendered.k, tail).reshape(*rendered.linear.shape)
    # 4e-6 is met: where the others of a bin are hardly more than LEAST_OTHERS, their mean is a difference that cancels.
    np.testing.assert_allclose(rendered.linear, simulated, atol=1e-5, rtol=0)


def test_answers_equal_those_of_the_numpy_network(
    deep: KBufferDeep, network: Weights, frame: Frame, dump: FragmentDump, features: NDArray[np.float32]
) -> None:
    pixels = np.flatnonzero(dump.counts).astype(np.uint32)
    read = deep.features(frame, pixels)
    wide = np.zeros((len(pixels), len(FEATURES)), np.float32)
    wide[:, network.columns] = read
    expected = network.run(wide)
    difference = np.abs(deep.predict(frame, pixels) - expected) / np.maximum(1.0, np.abs(expected))
    assert difference.max() < 1e-4, "of the features that it read"
    from_dump = network.run(features[pixels])
    difference = np.abs(deep.predict(frame, pixels) - from_dump) / np.maximum(1.0, np.abs(from_dump))
    assert difference.max() < 1e-3, "of what the dump says"


@pytest.mark.parametrize("tail", BINNED_TAILS)
def test_ranks_are_those_of_numpy(frame: Frame, dump: FragmentDump, tmp_path: Path, tail: TailName) -> None:
    network, features = random_weights(7, FEW, tail=tail), derive(gather(dump, tail))
    export_random(tmp_path, network, features[dump.counts > 0], tail)
    ranks, counts = ranks_and_counts(KBufferDeep(tmp_path), frame)
    assert np.array_equal(counts, bin_counts(dump, tail)[:, : TAILS[tail].bins])
    prices = gain_prices(network.run(features), feature_prior(features, counts, TAILS[tail]))
    occupied = dump.counts > 0
    expected = ranks_of(prices, counts)[occupied].astype(int)
    apart = np.abs(ranks[occupied].astype(int) - expected)
    # A rank is rounded down, in float32 here and there.
    assert apart.max() <= 1
    assert (apart > 0).mean() < 2e-3
    seen = expected[counts[occupied] > 0]
    assert ((seen > 0) & (seen < 255)).mean() > 0.2, "most of the rest is worth nothing to a random network"


@pytest.mark.parametrize("tail", BINNED_TAILS)
@pytest.mark.parametrize("share", SHARES)
def test_cuts_are_those_of_numpy_and_the_picture_is_as_simulated(
    frame: Frame,
    dump: FragmentDump,
    tmp_path: Path,
    tail: TailName,
    share: float,
) -> None:
    export_random(tmp_path, random_weights(7, FEW, tail=tail), derive(gather(dump, tail))[dump.counts > 0], tail)
    deep, fragments = KBufferDeep(tmp_path), int(share * dump.total)
    rendered = deep.render(frame, Budget(fragments, tail))
    assert np.array_equal(rendered.k, expected_k(deep, frame, fragments))
    assert rendered.captured == rendered.k.sum() <= fragments
    assert_as_simulated(rendered, dump, tail)


def test_a_budget_is_met_up_to_one_bin_of_one_pixel(deep: KBufferDeep, frame: Frame, dump: FragmentDump) -> None:
    counts = counted(frame)
    most = int(counts.max())
    for fragments in (0, 1, 2, dump.pixels // 8, dump.total // 3, dump.total // 2, dump.total - 1):
        rendered = deep.render(frame, Budget(fragments))
        assert fragments - most < rendered.captured <= fragments
        assert np.array_equal(rendered.k, expected_k(deep, frame, fragments))
        assert rendered.skips[PREDICTOR] == 0
        assert_as_simulated(rendered, dump)


@pytest.mark.parametrize("more", [0, 1000])
def test_all_fragments_are_the_exact_picture_and_need_no_network(
    deep: KBufferDeep, fresh: Frame, dump: FragmentDump, more: int
) -> None:
    rendered = deep.render(fresh, Budget(dump.total + more))
    assert not fresh.counted
    assert np.array_equal(rendered.k, dump.counts)
    assert rendered.skips[PREDICTOR] == 1
    exact = composite(dump, dump.counts).reshape(rendered.linear.shape)
    np.testing.assert_allclose(rendered.linear, exact, atol=1e-6, rtol=0)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.9, 1.5])
def test_nothing_is_read_back_before_the_picture(
    deep: KBufferDeep, fresh: Frame, dump: FragmentDump, share: float, unread_until_pictured: list[bool]
) -> None:
    rendered = deep.render(fresh, Budget(int(share * dump.total)))
    assert rendered.captured <= int(share * dump.total)
    assert len(unread_until_pictured) == 1


def test_there_are_two_geometry_passes_beside_that_of_the_ranges(
    deep: KBufferDeep, fresh: Frame, dump: FragmentDump, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[str] = []
    draw = fresh.gpu.draw
    monkeypatch.setattr(fresh.gpu, "draw", lambda shader, *a, **k: (drawn.append(shader), draw(shader, *a, **k))[1])
    rendered = deep.render(fresh, Budget(dump.total // 3))
    assert drawn == ["range/range.frag", "gather/bins.frag", "kbuffer-deep/capture.frag"]
    passes = ["opaque", "range", "bins", "predict", "allocate", "capture", "sort", "resolve"]
    assert list(rendered.passes) == passes


def test_a_picture_is_identical_from_run_to_run(
    deep: KBufferDeep, gl: moderngl.Context, frame: Frame, dump: FragmentDump
) -> None:
    for share in SHARES:
        budget = Budget(int(share * dump.total))
        again = Frame(GpuScene(gl, shells()), VIEW, *SIZE, float_sums=True)
        one, two = (deep.render(each, budget) for each in (frame, again))
        assert np.array_equal(one.k, two.k)
        assert np.array_equal(one.linear, two.linear)


def test_one_frame_serves_several_budgets_and_techniques(
    deep: KBufferDeep, bundle: Path, fresh: Frame, frame: Frame, dump: FragmentDump
) -> None:
    """Its counts become cuts: what a frame keeps for the next technique is not what this one changed."""
    for part in (2, 3, 5):
        budget = Budget(dump.total // part)
        assert np.array_equal(deep.render(fresh, budget).k, KBufferDeep(bundle).render(frame, budget).k)


@pytest.mark.parametrize("other", [name for name in TAIL_NAMES if name != DEFAULT_TAIL])
def test_a_bundle_renders_its_own_tail_alone(deep: KBufferDeep, frame: Frame, other: TailName) -> None:
    with pytest.raises(Problem, match=f"trained with, {DEFAULT_TAIL}, not {other}") as caught:
        deep.render(frame, Budget(100, other))
    assert caught.value.code == ExitCode.USAGE
    assert "--tail" in caught.value.remedy


def test_importances_meet_the_budget_as_their_network_says(
    tmp_path: Path, fresh: Frame, dump: FragmentDump, features: NDArray[np.float32]
) -> None:
    network = random_weights(5, FEW, (8,), "importance")
    export_random(tmp_path, network, features[dump.counts > 0])
    deep = KBufferDeep(tmp_path)
    pixels = np.flatnonzero(dump.counts).astype(np.uint32)
    expected = network.run(features[pixels])
    np.testing.assert_allclose(deep.predict(fresh, pixels), expected, rtol=1e-3, atol=1e-3)
    for share in SHARES:
        fragments = int(share * dump.total)
        rendered = deep.render(fresh, Budget(fragments))
        assert np.array_equal(rendered.k, expected_k(deep, fresh, fragments))
        assert rendered.captured <= fragments
        assert_as_simulated(rendered, dump)


def test_onnx_and_glsl_give_the_same_picture(deep: KBufferDeep, bundle: Path, frame: Frame, dump: FragmentDump) -> None:
    other = KBufferDeep(bundle, "onnx")
    pixels = np.flatnonzero(dump.counts).astype(np.uint32)
    np.testing.assert_allclose(other.predict(frame, pixels), deep.predict(frame, pixels), rtol=1e-5, atol=1e-5)
    for share in SHARES:
        budget = Budget(int(share * dump.total))
        one, two = deep.render(frame, budget), other.render(frame, budget)
        same = one.k == two.k
        assert same.mean() > 0.999
        assert two.captured <= budget.fragments
        assert_as_simulated(two, dump)
        difference = np.abs(display8(one.linear).astype(int) - display8(two.linear).astype(int)).reshape(-1, 3)
        assert difference[same].max() <= 1


@pytest.mark.parametrize("fragments", [0, 10**7])
def test_onnx_with_no_budget_and_more_than_enough(
    bundle: Path, frame: Frame, dump: FragmentDump, fragments: int
) -> None:
    rendered = KBufferDeep(bundle, "onnx").render(frame, Budget(fragments))
    assert rendered.captured == min(fragments, dump.total)
    assert rendered.skips[PREDICTOR] == (fragments > 0)
    assert_as_simulated(rendered, dump)


def test_features_are_read_in_blocks_as_at_once(
    deep: KBufferDeep, frame: Frame, dump: FragmentDump, monkeypatch: pytest.MonkeyPatch
) -> None:
    pixels = np.flatnonzero(dump.counts).astype(np.uint32)
    features, gain = deep.features(frame, pixels), deep.predict(frame, pixels)
    monkeypatch.setattr("renderer.techniques.kbuffer_deep._DISPATCH", 1000)
    assert len(pixels) > 2000
    assert np.array_equal(deep.features(frame, pixels), features)
    assert np.array_equal(deep.predict(frame, pixels), gain)


def test_only_what_the_bundle_reads_is_gathered_and_its_bytes_are_said(
    deep: KBufferDeep, network: Weights, frame: Frame, dump: FragmentDump
) -> None:
    row, luma = TAILS[DEFAULT_TAIL], 4 if network.features == FEATURES else 0
    peak = row.gathered_bytes + luma + row.sum_bytes
    for fragments in (dump.pixels // 3, 2 * dump.pixels, 2 * dump.pixels + 1):
        rendered = deep.render(frame, Budget(fragments))
        assert rendered.skips[UNREAD_LUMA] == (luma == 0)
        assert rendered.early_bytes == peak
        assert rendered.pool_bytes == 8 * fragments
        # Two slots a pixel lie in words that it no longer needs.
        own_pool = 8 * fragments if fragments > 2 * dump.pixels else 0
        assert rendered.total_bytes == peak * dump.pixels + own_pool


@pytest.mark.parametrize(("size", "away"), [((1, 1), False), ((3, 2), False), ((61, 45), False), ((8, 8), True)])
def test_small_and_empty_pictures(deep: KBufferDeep, gl: moderngl.Context, size: tuple[int, int], away: bool) -> None:
    view = VIEW.model_copy(update={"target": (VIEW.eye[0], VIEW.eye[1], 2.0 * VIEW.eye[2])}) if away else VIEW
    frame = Frame(GpuScene(gl, shells()), view, *size)
    n = frame.count()
    assert n.any() != away
    for fragments in {0, 1, max(int(n.sum()) - 1, 0), int(n.sum())}:
        rendered = deep.render(frame, Budget(fragments))
        assert rendered.captured <= fragments
        assert np.array_equal(rendered.k, expected_k(deep, frame, fragments))
        assert np.isfinite(rendered.linear).all()


def test_counts_of_a_frame_are_all_usable(frame: Frame, dump: FragmentDump) -> None:
    """Of the shared frame: what the tests above call N is what can be in a core."""
    assert usable_counts(counted(frame)).sum() == dump.total
