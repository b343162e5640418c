"""Adam against its definition."""

from __future__ import annotations

import numpy as np
import torch

from trainer.adam import Adam


def test_steps_are_those_of_the_paper() -> None:
    rng = np.random.default_rng(0)
    parameter = torch.tensor(rng.normal(size=(3, 2)), requires_grad=True)
    expected, m, v = parameter.detach().numpy().copy(), np.zeros((3, 2)), np.zeros((3, 2))
    adam = Adam([parameter])
    for t in range(1, 20):
        gradient, lr = rng.normal(size=(3, 2)), 0.1 / t
        parameter.grad = torch.from_numpy(gradient)
        adam.step(lr)
        m, v = 0.9 * m + 0.1 * gradient, 0.999 * v + 0.001 * gradient**2
        expected -= lr * (m / (1 - 0.9**t)) / (np.sqrt(v / (1 - 0.999**t)) + 1e-8)
    np.testing.assert_allclose(parameter.detach().numpy(), expected, rtol=1e-10)


def test_a_parameter_without_gradient_stays() -> None:
    parameter = torch.ones(2, requires_grad=True)
    adam = Adam([parameter])
    adam.step(1.0)
    assert parameter.tolist() == [1.0, 1.0]
