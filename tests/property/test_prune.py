"""A network without its unused parts answers what it answered before."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.training import random_weights

from renderer.features import FEATURES
from schemas.bundle import FEATURE_LIMIT
from trainer.prune import pruned
from trainer.weights import Weights

HIDDEN = st.lists(st.integers(1, 6), max_size=3).map(tuple)


@st.composite
def sparse(draw: st.DrawFn) -> Weights:
    """A random network in which inputs, units and biases were put out of use, or nearly."""
    seed = draw(st.integers(0, 2**16))
    weights = random_weights(seed, FEATURES[: draw(st.integers(1, 5))], draw(HIDDEN))
    rng = np.random.default_rng(seed)
    share = draw(st.sampled_from([0.0, 0.3, 0.7, 1.0]))
    for weight, bias in weights.layers:
        weight[rng.random(weight.shape) < share] = 0.0
        weight[:, rng.random(weight.shape[1]) < share] = 0.0
        bias[rng.random(len(bias)) < share] -= draw(st.sampled_from([0.0, 1.0, 30.0]))
    return weights


@settings(max_examples=150, deadline=None)
@given(sparse(), st.integers(0, 2**16))
def test_the_answers_stay(weights: Weights, seed: int) -> None:
    rows = np.random.default_rng(seed).normal(0.0, 3.0, (300, len(FEATURES))).astype(np.float32)
    corners = np.sign(rows[:100]) * 1e3
    inputs = np.concatenate([rows, corners.astype(np.float32)])
    small = pruned(weights)
    np.testing.assert_allclose(small.run(inputs), weights.run(inputs), rtol=2e-6, atol=2e-6)
    assert set(small.features) <= set(weights.features)
    assert len(small.hidden) == len(weights.hidden)
    again = pruned(small)
    assert again.digest() == small.digest()


@settings(max_examples=50, deadline=None)
@given(sparse())
def test_nothing_is_left_that_nothing_reads(weights: Weights) -> None:
    small = pruned(weights)
    for weight, _ in small.layers:
        assert weight.shape[1] == 1 or weight.any(axis=0).all()


def test_what_is_used_stays() -> None:
    weights = random_weights(7)
    assert pruned(weights).digest() == weights.digest()


@pytest.mark.parametrize("bias", [-1.001, -0.999])
def test_a_unit_goes_only_if_no_input_can_wake_it(bias: float) -> None:
    weights = random_weights(1, ("log_n", "depth_std"), (2,))
    weights.layers[0][0][:] = [[1.0, -1.0], [1.0, 1.0]]
    weights.layers[0][1][:] = [bias * 2.0 * FEATURE_LIMIT, 0.0]
    assert pruned(weights).hidden == ((1,) if bias < -1.0 else (2,))


def test_features_that_only_a_silent_unit_reads_go_too() -> None:
    weights = random_weights(2, ("log_n", "depth_std", "alpha_mean"), (3, 2))
    weights.layers[0][0][:] = [[1.0, 0.0, 1.0], [0.0, 1.0, 0.0], [2.0, 0.0, 1.0]]
    weights.layers[0][1][:] = [0.0, -100.0, 0.0]
    weights.layers[1][1][:] = 1.0
    small = pruned(weights)
    assert small.features == ("log_n", "alpha_mean")
    assert small.hidden == (2, 2)
    np.testing.assert_array_equal(small.mean, weights.mean[[0, 2]])
