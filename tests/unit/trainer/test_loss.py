"""The Lagrangian regret against its definition by brute force."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from trainer.loss import lagrangian_regret


def brute_force(k: float, slopes: list[float], lengths: list[int], lam: float) -> float:
    """`(E(k) + lam k - min_j (E(j) + lam j)) / lam`, E the interpolated hull through its vertices."""
    ks = np.concatenate([[0], np.cumsum(lengths)])
    drops = np.array(slopes) * np.array(lengths)
    errors = drops.sum() - np.concatenate([[0.0], np.cumsum(drops)])
    cost = np.interp(k, ks, errors) + lam * k
    return float((cost - (errors + lam * ks).min()) / lam)


def tensors(*values: float) -> list[torch.Tensor]:
    return [torch.tensor([value], dtype=torch.float32) for value in values]


hulls = st.lists(st.tuples(st.floats(-9.0, 0.0), st.integers(1, 4)), min_size=1, max_size=6)


@given(
    hull=hulls, a=st.floats(-9.0, 3.0), b=st.floats(0.1, 3.0), log_lambda=st.floats(-8.0, -1.0), extra=st.integers(0, 3)
)
@settings(max_examples=200, deadline=None)
def test_regret_is_that_of_the_definition(
    hull: list[tuple[float, int]], a: float, b: float, log_lambda: float, extra: int
) -> None:
    slopes = sorted((math.exp(s) for s, _ in hull), reverse=True)
    lengths = [length for _, length in hull]
    n = sum(lengths) + extra
    r, _ = lagrangian_regret(
        *tensors(a, b, n), torch.tensor([slopes]), torch.tensor([lengths]).float(), *tensors(log_lambda)
    )
    k = min(max(1.0 + (a - log_lambda) / b, 0.0), n)
    expected = brute_force(k, slopes, lengths, math.exp(log_lambda))
    assert float(r) == pytest.approx(expected, rel=1e-3, abs=1e-3)


def test_the_optimum_has_no_regret_at_all() -> None:
    slopes, lengths = torch.tensor([[0.5, 0.01, 0.0]]), torch.tensor([[2.0, 3.0, 0.0]])
    # log lambda between the slopes: take the first segment, k* = 2.
    r, overshoot = lagrangian_regret(*tensors(1.0 - 2.0, 1.0, 6.0), slopes, lengths, *tensors(-2.0))
    assert float(r) == 0.0
    assert float(overshoot) == 0.0


def test_a_pixel_without_a_hull_regrets_every_fragment() -> None:
    nothing = torch.zeros(1, 3)
    r, _ = lagrangian_regret(*tensors(1.0, 1.0, 9.0), nothing, nothing, *tensors(-3.0))
    assert float(r) == pytest.approx(5.0)
    r, overshoot = lagrangian_regret(*tensors(-9.0, 1.0, 9.0), nothing, nothing, *tensors(-3.0))
    assert float(r) == float(overshoot) == 0.0, "k = 0, where the optimum is"


@pytest.mark.parametrize(("a", "direction"), [(20.0, 1.0), (-20.0, -1.0)])
def test_a_clamped_count_on_the_wrong_side_still_has_a_gradient(a: float, direction: float) -> None:
    slopes, lengths = torch.tensor([[0.5, 1e-5]]), torch.tensor([[2.0, 4.0]])
    gain = torch.tensor([a], requires_grad=True)
    r, overshoot = lagrangian_regret(gain, *tensors(1.0, 7.0), slopes, lengths, *tensors(-4.0))
    (r + overshoot).sum().backward()
    assert float(r.detach()) > 0.5
    assert gain.grad is not None
    assert float(gain.grad) * direction > 0.0


def test_a_count_clamped_where_the_optimum_is_costs_nothing() -> None:
    slopes, lengths = torch.tensor([[0.5]]), torch.tensor([[4.0]])
    r, overshoot = lagrangian_regret(*tensors(20.0, 1.0, 4.0), slopes, lengths, *tensors(-4.0))
    assert float(r) == float(overshoot) == 0.0
