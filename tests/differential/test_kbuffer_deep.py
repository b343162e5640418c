"""`kbuffer-deep` in the frame against the same network, features and lambda on the CPU."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from support.training import random_weights

from labeller.curves import composite
from renderer.allocation.fill import feasible_k_min, solve_lambda
from renderer.features import FEATURES, derive, gather
from renderer.frame import Frame
from renderer.techniques import Budget, KBufferDeep
from schemas.bundle import Provenance, TailSpec
from schemas.colour import display8
from schemas.fragments import FragmentDump
from trainer.bundle import Description, export_bundle
from trainer.weights import Weights


@pytest.fixture(scope="module", params=[FEATURES, ("log_n", "optical_depth", "rgb_nearest_g", "depth_std")])
def network(request: pytest.FixtureRequest) -> Weights:
    return random_weights(11, request.param)


@pytest.fixture(scope="module")
def deep(
    network: Weights, dump: FragmentDump, gl: moderngl.Context, tmp_path_factory: pytest.TempPathFactory
) -> KBufferDeep:
    folder = tmp_path_factory.mktemp("bundle")
    description = Description(
        name="random",
        tail=TailSpec(name="density", g=0.75),
        metric="display",
        k_min=1,
        provenance=Provenance(scenes={}, code_version="0", seed=0, machine="test"),
        evaluation={},
    )
    export_bundle(folder, network, description, derive(gather(dump))[dump.counts > 0], gl)
    return KBufferDeep(folder)


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
