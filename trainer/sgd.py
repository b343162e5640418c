"""Stochastic gradient descent without momentum, as DHOIT trains; see `trainer.adam` for why not torch's."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import torch
from torch import Tensor


class Optimiser(Protocol):
    """What a training asks of an optimiser; `trainer.adam` is another."""

    steps: int

    def zero_grad(self) -> None:
        """Forget the gradients."""

    def step(self, lr: float) -> None:
        """One step along the gradients."""

    def state(self) -> dict[str, Tensor]:
        """By name, all that `restore` needs beside `steps`."""

    def restore(self, state: dict[str, Tensor], steps: int) -> None:
        """Continue from a state."""


class Sgd:
    """`x -= lr * gradient`.

    Args:
        parameters: What is optimised, in place.
    """

    def __init__(self, parameters: Iterable[Tensor]) -> None:
        self._parameters = list(parameters)
        self.steps = 0

    def zero_grad(self) -> None:
        """Forget the gradients."""
        for parameter in self._parameters:
            parameter.grad = None

    @torch.no_grad()
    def step(self, lr: float) -> None:
        """One step along the gradients.

        Args:
            lr: Learning rate.
        """
        self.steps += 1
        for parameter in self._parameters:
            if parameter.grad is not None:
                parameter.add_(parameter.grad, alpha=-lr)

    def state(self) -> dict[str, Tensor]:
        """Nothing: it has no memory."""
        return {}

    def restore(self, state: dict[str, Tensor], steps: int) -> None:
        """Continue from a state.

        Args:
            state: What `state` gave.
            steps: Steps that had been done.
        """
        assert not state, "there is nothing to restore"
        self.steps = steps
