"""The Lagrangian regret of whole bins against its definition by brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from trainer.loss import SOFTNESS, lagrangian_regret, rising_prices

FAR = 60.0 * SOFTNESS
"""So far from the price that a bin is wholly taken, or not at all."""

bins = st.lists(st.tuples(st.floats(-9.0, 0.0), st.integers(0, 4)), min_size=1, max_size=8)


def brute_force(cut: int, slopes: list[float], counts: list[int], lam: float) -> float:
    """`(E(k) + lam k - min (E(j) + lam j)) / lam` over cuts, E what the bins behind a cut would gain."""
    costs = [
        sum(s * n for s, n in list(zip(slopes, counts, strict=True))[c:]) + lam * sum(counts[:c])
        for c in range(len(counts) + 1)
    ]
    return (costs[cut] - min(costs)) / lam


def regret(prices: list[float], counts: list[int], slopes: list[float], log_lambda: float) -> tuple[float, float]:
    r, astray = lagrangian_regret(
        torch.tensor([prices]), torch.tensor([counts]).float(), torch.tensor([slopes]), torch.tensor([log_lambda])
    )
    return float(r), float(astray)


@given(bins, st.floats(-8.0, -1.0), st.data())
@settings(max_examples=200, deadline=None)
def test_regret_of_a_hard_cut_is_that_of_the_definition(
    given_bins: list[tuple[float, int]], log_lambda: float, data: st.DataObject
) -> None:
    slopes = sorted((math.exp(s) for s, _ in given_bins), reverse=True)
    counts = [n for _, n in given_bins]
    cut = data.draw(st.integers(0, len(counts)))
    prices = [-log_lambda - FAR] * cut + [-log_lambda + FAR] * (len(counts) - cut)
    r, _ = regret(prices, counts, slopes, log_lambda)
    assert r == pytest.approx(brute_force(cut, slopes, counts, math.exp(log_lambda)), rel=1e-3, abs=1e-3)


def test_the_optimum_has_no_regret() -> None:
    r, astray = regret([2.0 - FAR, 2.0 + FAR], [2, 3], [0.5, 0.01], -2.0)
    assert r == pytest.approx(0.0, abs=1e-6)
    assert astray == 0.0


def test_without_a_gain_every_fragment_is_regretted() -> None:
    assert regret([-FAR, -FAR], [4, 5], [0.0, 0.0], -3.0)[0] == pytest.approx(9.0)
    assert regret([3.0 + FAR, 3.0 + FAR], [4, 5], [0.0, 0.0], -3.0) == (pytest.approx(0.0, abs=1e-6), 0.0)


def test_bins_without_fragments_cost_nothing() -> None:
    assert regret([-FAR, FAR], [0, 0], [0.5, 0.5], -3.0) == (0.0, 0.0)


@pytest.mark.parametrize("gain", [20.0, -20.0])
def test_a_bin_far_on_the_wrong_side_still_has_a_gradient(gain: float) -> None:
    slopes, counts = torch.tensor([[0.5, 1e-5]]), torch.tensor([[2.0, 4.0]])
    gains = torch.full((1, 2), gain, requires_grad=True)
    r, astray = lagrangian_regret(rising_prices(gains, counts), counts, slopes, torch.tensor([-4.0]))
    (r + astray).sum().backward()
    assert float(r.detach()) > 0.5
    assert gains.grad is not None
    assert float(gains.grad.sum()) * gain > 0.0, "less of a gain that is too large, more of one that is too small"


def test_prices_rise_and_empty_bins_are_no_reason() -> None:
    gains, counts = torch.tensor([[-5.0, -1.0, -90.0, -6.0]]), torch.tensor([[1.0, 1.0, 0.0, 1.0]])
    assert rising_prices(gains, counts).tolist() == [[5.0, 5.0, 5.0, 6.0]]
    assert np.isneginf(-rising_prices(gains, 0.0 * counts).numpy()).sum() == 0
