"""Hull segments, batches and normalisation."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support.dumps import random_dump
from support.training import random_view

from labeller.curves import error_curves
from labeller.hull import lower_hulls
from labeller.shards import read_shard, write_shard
from renderer.features import FEATURES
from schemas.problem import Problem
from schemas.tail import DEFAULT_TAIL, TAILS
from trainer.config import TrainConfig
from trainer.dataset import GROUP, Drawing, ViewData, load_shards, make_view, normalisation, sample_batch
from trainer.heads import HEADS
from trainer.segments import SEGMENTS, bin_slopes


def view_of(hulls: list[tuple[list[int], list[float]]], prices: tuple[float, float] = (-9.0, -1.0)) -> ViewData:
    offsets = np.concatenate([[0], np.cumsum([len(k) for k, _ in hulls])]).astype(np.int64)
    return make_view(
        "one",
        features=np.zeros((len(hulls), len(FEATURES)), np.float32),
        n=np.array([max(k, default=2) + 1 for k, _ in hulls], np.int32),
        tail=DEFAULT_TAIL,
        bin_counts=np.zeros((len(hulls), TAILS[DEFAULT_TAIL].bins), np.uint8),
        hull=(
            offsets,
            np.concatenate([np.array(k, np.int32) for k, _ in hulls]),
            np.concatenate([np.array(e, np.float32) for _, e in hulls]),
        ),
        price_range=prices,
        anchors=[],
        sampled_pixels=1.0,
    )


def convex_hull(vertices: int) -> tuple[list[int], list[float]]:
    return list(range(vertices)), [float((vertices - 1 - k) ** 2) for k in range(vertices)]


def test_segments_are_the_slopes_between_the_vertices() -> None:
    view = view_of([([0, 2, 3], [1.0, 0.5, 0.0]), ([], []), ([0, 1], [0.25, 0.0])])
    np.testing.assert_array_equal(view.offsets, [0, 2, 2, 3])
    np.testing.assert_allclose(view.slopes, [0.25, 0.5, 0.25])
    np.testing.assert_array_equal(view.lengths, [2, 1, 1])


def hull_errors(view: ViewData, k: NDArray[np.float64]) -> NDArray[np.float64]:
    ks = np.concatenate([[0.0], np.cumsum(view.lengths)])
    drops = (view.slopes * view.lengths).astype(np.float64)
    return np.asarray(np.interp(k, ks, drops.sum() - np.concatenate([[0.0], np.cumsum(drops)])), dtype=np.float64)


def test_long_hulls_are_simplified_from_above_and_stay_convex() -> None:
    ks, errors = convex_hull(90)
    view = view_of([(ks, errors)])
    assert len(view.slopes) == SEGMENTS
    assert (np.diff(view.slopes) < 0.0).all()
    assert view.lengths.sum() == 89
    simplified = hull_errors(view, np.arange(90.0))
    assert (simplified >= np.array(errors) - 1e-3).all()
    assert (simplified - np.array(errors)).max() < 0.002 * errors[0]


def test_prices_below_the_lossless_error_are_not_drawn() -> None:
    steep = ([1, 2, 3, 4], [1.0, 1e-1, 1e-6, 0.0])
    view = replace(view_of([steep] * 4, prices=(-40.0, -1.0)))
    assert np.log(1e-6) - 1.0 < view.price_range[0] < 0.0
    assert view.price_range[1] == -1.0


def test_a_batch_is_the_same_for_the_same_seed_and_differs_by_step() -> None:
    views = [random_view("a", 1), random_view("b", 2)]
    first, again, other = (sample_batch(views, [0, 3], (7, step), 4 * GROUP) for step in (5, 5, 6))
    np.testing.assert_array_equal(first.features, again.features)
    np.testing.assert_array_equal(first.log_lambda, again.log_lambda)
    assert not np.array_equal(first.log_lambda, other.log_lambda)


def plain_slopes(view: ViewData, row: int) -> list[float]:
    """What each fragment of each bin gains, fragment by fragment."""
    part = slice(view.offsets[row], view.offsets[row + 1])
    gains = [
        float(slope) for slope, n in zip(view.slopes[part], view.lengths[part], strict=True) for _ in range(int(n))
    ]
    found, before = [], 0
    for own in view.bin_counts[row].tolist():
        of_bin = gains[before : before + own]
        assert len(set(of_bin)) <= 1, "a hull has no vertex within a bin"
        found.append(of_bin[0] if of_bin else math.nan)
        before += own
    return found


def test_a_batch_holds_what_the_rows_bins_gain() -> None:
    view = random_view("a", 3)
    batch = sample_batch([view], list(range(len(FEATURES))), (0, 0), GROUP)
    for i in range(GROUP):
        row = np.flatnonzero((view.features == batch.features[i]).all(axis=1))[0]
        np.testing.assert_array_equal(batch.counts[i], view.bin_counts[row])
        expected = np.array(plain_slopes(view, row), np.float32)
        known = ~np.isnan(expected)
        np.testing.assert_array_equal(batch.slopes[i][known], expected[known])
        assert (batch.slopes[i][~known & (batch.counts[i] > 0)] == 0.0).all(), "behind the hull's end"
        np.testing.assert_array_equal(batch.prior[i], view.prior(np.array([row]))[0])


@pytest.mark.parametrize("seed", range(5))
def test_a_bin_gains_what_the_segment_of_its_middle_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    segments = [int(number) for number in rng.integers(0, 6, 30)]
    offsets = np.concatenate([[0], np.cumsum(segments)]).astype(np.int64)
    slopes = np.concatenate([-np.sort(-rng.random(number)) for number in segments]).astype(np.float32)
    lengths = rng.integers(1, 9, len(slopes)).astype(np.float32)
    # Segments of simplified hulls end within bins, and lists go on behind their hulls.
    rows, counts = rng.permutation(30), rng.integers(0, 7, (30, 8)).astype(np.float32)
    found = np.full((30, 8), np.nan, np.float32)
    bin_slopes(offsets, slopes, lengths, rows, counts, found)
    for i, row in enumerate(rows):
        part = slice(offsets[row], offsets[row + 1])
        # Two entries for each fragment: the middle of a bin is between fragments, or of one.
        halves = [slope for slope, n in zip(slopes[part], lengths[part], strict=True) for _ in range(2 * int(n))]
        for b in range(8):
            middle = int(2 * counts[i, :b].sum() + counts[i, b])
            assert found[i, b] == (halves[middle] if middle < len(halves) else 0.0)


def test_a_network_is_trained_for_one_tail() -> None:
    other = replace(random_view("b", 2), tail="binned-8")
    with pytest.raises(Problem, match="binned-12, binned-8: a network is trained for one"):
        HEADS["bin-gains"].network([random_view("a", 1), other], TrainConfig())


def test_assets_are_drawn_equally_often_however_many_views_they_have() -> None:
    rare = random_view("rare", 1)
    rare.features[:, 0] = -1.0
    views = [rare, *(random_view("common", seed) for seed in range(2, 7))]
    drawn = np.concatenate([sample_batch(views, [0], (0, step), 8 * GROUP).features[:, 0] for step in range(40)])
    assert 0.4 < (drawn == -1.0).mean() < 0.6


def test_processes_share_the_groups_of_a_batch() -> None:
    views = [random_view("a", 1), random_view("b", 2)]
    whole, *parts = (
        sample_batch(views, [0, 3], (7, 5), 5 * GROUP, drawing)
        for drawing in (None, Drawing(rank=0, size=2), Drawing(rank=1, size=2))
    )
    assert [part.share for part in (whole, *parts)] == [1.0, 0.6, 0.4]
    for rank, part in enumerate(parts):
        for name in ("features", "slopes", "log_lambda"):
            groups = getattr(whole, name).reshape(5, GROUP, -1)[rank::2]
            np.testing.assert_array_equal(getattr(part, name).reshape(groups.shape), groups)
        np.testing.assert_array_equal(part.scale, whole.scale[rank::2])


def test_replayed_views_have_their_share() -> None:
    new, old = random_view("new", 1), random_view("old", 2)
    new.features[:, 0], old.features[:, 0] = 0.0, 1.0
    drawing = Drawing(replay=[old], replay_share=0.25)
    drawn = [sample_batch([new], [0], (0, step), 8 * GROUP, drawing).features.mean() for step in range(50)]
    assert 0.2 < np.mean(drawn) < 0.3


def test_hard_views_are_drawn_by_their_hardness() -> None:
    easy, hard = random_view("easy", 1), random_view("hard", 2)
    easy.features[:, 0], hard.features[:, 0] = 0.0, 1.0
    drawing = Drawing(hardness=[1.0, 9.0], mining=1.0)
    drawn = [sample_batch([easy, hard], [0], (0, step), 8 * GROUP, drawing).features.mean() for step in range(50)]
    assert 0.85 < np.mean(drawn) < 0.95


def test_noise_has_the_spread_that_is_asked_for_and_changes_nothing_else() -> None:
    views = [random_view("a", 1)]
    plain, noisy = (
        sample_batch(views, [0, 3], (7, 5), 20 * GROUP, drawing)
        for drawing in (None, Drawing(noise=np.array([0.5, 0.0], np.float32)))
    )
    added = noisy.features - plain.features
    assert added[:, 0].std() == pytest.approx(0.5, rel=0.1)
    assert (added[:, 1] == 0.0).all()
    np.testing.assert_array_equal(plain.slopes, noisy.slopes)


def test_normalisation_weighs_assets_equally() -> None:
    one, two = random_view("one", 1), random_view("two", 2)
    one.features[:], two.features[:] = 0.0, 1.0
    views = [one, two, two, two]
    mean, std = normalisation([view.asset for view in views], [view.moments() for view in views])
    np.testing.assert_allclose(mean, 0.5)
    np.testing.assert_allclose(std, 0.5)


def test_shards_become_views(tmp_path: Path) -> None:
    dump = random_dump(60, 40, 9, seed=1)
    curves = error_curves(dump)
    path = tmp_path / "view.safetensors"
    write_shard(path, dump, curves, lower_hulls(curves), [dump.total // 3], fraction=0.5, seed=2)
    shard = read_shard(path)
    (view,) = load_shards([path], ["box"])
    assert view.asset == "box"
    np.testing.assert_array_equal(view.features, shard.features)
    np.testing.assert_allclose(view.anchors, shard.anchors)
    row = int(np.argmax(view.n))
    part = slice(view.offsets[row], view.offsets[row + 1])
    hull = slice(shard.hull_offsets[row], shard.hull_offsets[row + 1])
    gained = (view.slopes[part] * view.lengths[part]).sum()
    assert gained == pytest.approx(shard.hull_error[hull][0] - shard.hull_error[hull][-1], rel=1e-5)


def test_shards_of_single_layers_are_refused(tmp_path: Path) -> None:
    dump = random_dump(8, 8, 1, seed=1)
    curves = error_curves(dump)
    write_shard(tmp_path / "flat", dump, curves, lower_hulls(curves), [10])
    with pytest.raises(Problem, match="nothing to learn"):
        load_shards([tmp_path / "flat"], ["flat"])


def test_a_subset_keeps_rows_and_hulls_together() -> None:
    view = random_view("a", 4)
    part = view.subset(50, seed=0)
    assert part.rows == 50
    assert part.sampled_pixels == pytest.approx(view.sampled_pixels * 50 / view.rows)
    for i in (0, 17, 49):
        row = np.flatnonzero((view.features == part.features[i]).all(axis=1))[0]
        np.testing.assert_array_equal(
            part.slopes[part.offsets[i] : part.offsets[i + 1]], view.slopes[view.offsets[row] : view.offsets[row + 1]]
        )
