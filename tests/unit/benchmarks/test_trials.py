"""Trials of the benchmark of predictors: lower resolution, other scenes of the same fragments, distillation."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from support.dumps import random_dump
from support.training import random_view, random_weights

from benchmarks.predicting.augmentation import REMAPS, Remap, recoloured, remapped
from benchmarks.predicting.cost import network_cost
from benchmarks.predicting.distilled import DistilledHead, taught_gains
from benchmarks.predicting.inputs import BLOCKS, Inputs, changed, stand_ins
from labeller.curves import check_dump, error_curves
from labeller.hull import lower_hulls
from labeller.shards import read_shard, write_shard
from renderer.features import FEATURES, derive, gather
from trainer.config import TrainConfig
from trainer.dataset import GROUP, Drawing, ViewData, sample_batch
from trainer.heads import HEADS, batch_loss
from trainer.models import Network
from trainer.train import train

DUMP = random_dump(24, 16, 12, seed=5)
EXACT = (*("log_n", "optical_depth", "depth_extent"), *(name for name in FEATURES if name[:5] in ("front", "backg")))
"""Features that the count pass, the depth bins and the background know of every pixel."""


@settings(max_examples=60)
@given(
    width=st.integers(1, 9),
    height=st.integers(1, 9),
    block=st.sampled_from([2, 4]),
    share=st.sampled_from([0.1, 0.5, 1.0]),
    seed=st.integers(0, 999),
)
def test_stand_ins_are_the_nearest_occupied_pixels(
    width: int, height: int, block: int, share: float, seed: int
) -> None:
    occupied = np.random.default_rng(seed).random(width * height) < share
    found = stand_ins(occupied, width, block)
    for p in range(width * height):
        y0, x0 = p // width // block * block, p % width // block * block
        cells = [(y, x) for y in range(y0, min(y0 + block, height)) for x in range(x0, min(x0 + block, width))]
        full = [(y, x) for y, x in cells if occupied[y * width + x]] or cells
        away = [abs(y - y0 - 0.5 * (block - 1)) ** 2 + abs(x - x0 - 0.5 * (block - 1)) ** 2 for y, x in full]
        y, x = full[int(np.argmin(away))]
        assert found[p] == y * width + x


@pytest.mark.parametrize("inputs", BLOCKS)
@pytest.mark.parametrize("bins", [8, 16])
def test_lower_resolution_is_of_the_sums_alone(inputs: Inputs, bins: int) -> None:
    features = derive(gather(DUMP, bins))
    found = changed(features, inputs, DUMP.width)
    exact = [FEATURES.index(name) for name in EXACT]
    assert np.array_equal(found[:, exact], features[:, exact])
    others = [i for i in range(len(FEATURES)) if i not in exact]
    occupied = DUMP.counts > 0
    read = stand_ins(occupied, DUMP.width, BLOCKS[inputs])
    assert np.array_equal(found[occupied][:, others], features[read[occupied]][:, others])
    assert not found[~occupied].any()
    # Every block has one pixel's sums.
    rgb = found[:, FEATURES.index("rgb_mean_r")].reshape(DUMP.height, DUMP.width)
    size = BLOCKS[inputs]
    for y in range(0, DUMP.height, size):
        for x in range(0, DUMP.width, size):
            part = rgb[y : y + size, x : x + size][occupied.reshape(rgb.shape)[y : y + size, x : x + size]]
            assert len(np.unique(part)) <= 1


def test_lower_resolution_costs_a_part_of_the_sums() -> None:
    network = random_weights(1, FEATURES, (8,))
    whole, half, quarter = (network_cost(network, "density-8", block) for block in (1, 2, 4))
    sums = 5 * 8 + 4
    assert whole.feature_bytes == 8 + sums
    assert half.feature_bytes == quarter.feature_bytes == 8 + 2 * 8 + 4, "now the bins are the larger part"
    lean = network_cost(random_weights(1, ("log_n", "optical_depth"), (8,)), "density-8")
    assert whole.gather_bytes > half.gather_bytes == quarter.gather_bytes == lean.gather_bytes
    assert (half.weights, half.capture_bytes) == (whole.weights, whole.capture_bytes)
    unbinned = [network_cost(network, "weighted-average", block).feature_bytes for block in (1, 2, 4)]
    assert unbinned == [84, 21, 6]


@pytest.mark.parametrize("remap", REMAPS["opacities"])
def test_other_opacities_keep_everything_else(remap: Remap) -> None:
    made = remapped(DUMP, remap)
    check_dump(made)
    assert np.array_equal(made.rgba[:, :3], DUMP.rgba[:, :3])
    assert 0 < made.rgba[:, 3].min() <= made.rgba[:, 3].max() < 255
    assert (len(np.unique(made.rgba[:, 3])) > 1) == (remap == "by colour")


def test_cuts_part_a_view_by_colour() -> None:
    halves = [remapped(DUMP, remap) for remap in REMAPS["cuts"]]
    colours = [{tuple(colour) for colour in half.rgba[:, :3] // 32} for half in halves]
    assert not colours[0] & colours[1]
    assert min(half.total for half in halves) > 0.2 * DUMP.total
    for half in halves:
        check_dump(half)
    assert np.array_equal(halves[0].counts + halves[1].counts, DUMP.counts)
    for p in range(DUMP.pixels):
        part = slice(DUMP.offsets[p], DUMP.offsets[p + 1])
        every = [tuple(row) for row in np.column_stack([DUMP.depth[part], DUMP.rgba[part]])]
        for half in halves:
            own = slice(half.offsets[p], half.offsets[p + 1])
            kept = [tuple(row) for row in np.column_stack([half.depth[own], half.rgba[own]])]
            assert kept == [row for row in every if row in kept]


def test_a_view_that_is_gone_has_no_rows(tmp_path: Path) -> None:
    one = replace(DUMP, rgba=np.full_like(DUMP.rgba, 90))
    halves = sorted((remapped(one, remap) for remap in REMAPS["cuts"]), key=lambda half: half.total)
    assert [half.total for half in halves] == [0, DUMP.total]
    curves = error_curves(halves[0], "density-16")
    write_shard(tmp_path / "none.safetensors", halves[0], curves, lower_hulls(curves), [DUMP.pixels])
    assert len(read_shard(tmp_path / "none.safetensors").n) == 0


def test_other_colours_are_those_of_a_view_in_other_colours() -> None:
    features = derive(gather(DUMP, 16))
    made = recoloured(features, seed=3)
    seen = np.zeros(DUMP.pixels, dtype=int)
    for order in list(permutations(range(3)))[1:]:
        other = replace(DUMP, rgba=DUMP.rgba[:, [*order, 3]], background=DUMP.background[:, order])
        for metric in ("display", "linear"):
            errors = [error_curves(dump, "density-16", metric=metric).error for dump in (DUMP, other)]
            np.testing.assert_allclose(errors[1], errors[0], rtol=1e-6, atol=1e-12)
        seen += (derive(gather(other, 16)) == made).all(axis=1)
    occupied = DUMP.counts > 0
    assert (seen[occupied] == 1).all(), "every pixel in one of the five other orders"
    assert not np.array_equal(made[occupied], recoloured(features, seed=4)[occupied])


@pytest.fixture(scope="module")
def views() -> list[ViewData]:
    return [random_view("a", 1), random_view("b", 2)]


def test_a_teacher_is_asked_where_it_stops(views: list[ViewData]) -> None:
    teacher = random_weights(7)
    batch = sample_batch(views, teacher.columns, (0, 1), 8 * GROUP)
    k, gains = taught_gains(teacher, batch, batch.features)
    a, b = teacher.answer(batch.features).astype(np.float64).T
    for i in range(len(k)):
        wanted = min(max(1.0 + (a[i] - batch.log_lambda[i]) / b[i], 0.0), batch.n[i])
        assert k[i] == pytest.approx(wanted, rel=1e-5)
        assert gains[i] == pytest.approx(a[i] - b[i] * (wanted - 1.0), rel=1e-4, abs=1e-4)
    inside = (k > 0.0) & (k < batch.n)
    assert inside.any()
    np.testing.assert_allclose(gains[inside], batch.log_lambda[inside], atol=1e-4)


def test_a_network_that_is_its_teacher_has_nothing_to_learn(views: list[ViewData]) -> None:
    teacher = HEADS["gain-curve"].network(views, TrainConfig(seed=5)).weights()
    pupil, other = Network.from_weights(teacher), HEADS["gain-curve"].network(views, TrainConfig(seed=6))
    config = TrainConfig(batch=4 * GROUP)

    def loss(network: Network, share: float) -> float:
        return float(DistilledHead(teacher, share).loss(network, views, config, 2, Drawing()).detach())

    assert loss(pupil, 1.0) == pytest.approx(0.0, abs=1e-9)
    assert loss(other, 1.0) > 1e-5
    batch = sample_batch(views, teacher.columns, (config.seed, 2), config.batch)
    with torch.no_grad():
        regret = float(batch_loss(other, batch, config))
    assert loss(other, 0.25) == pytest.approx(0.25 * loss(other, 1.0) + 0.75 * regret, rel=1e-5)


def test_a_network_comes_nearer_to_its_teacher(views: list[ViewData]) -> None:
    teacher = train(views, (), TrainConfig(steps=60, batch=4 * GROUP, validate_every=60)).weights
    features = ("log_n", "optical_depth", "alpha_nearest")
    config = TrainConfig(steps=200, batch=4 * GROUP, validate_every=200, hidden=(8,), features=features)
    head, batch = DistilledHead(teacher, 1.0), sample_batch(views, range(len(FEATURES)), (9, 9), 8 * GROUP)
    inputs = batch.features[:, teacher.columns]
    k, gains = taught_gains(teacher, batch, inputs)
    wrong = []
    for steps in (1, 200):
        made = train(views, (), config.model_copy(update={"steps": steps}), head=head).weights
        assert set(made.features) <= set(features)
        a, b = made.predict(batch.features)
        wrong.append(np.abs(a - b * (k - 1.0) - gains).mean())
    assert wrong[1] < 0.5 * wrong[0]
