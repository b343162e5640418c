"""Adam, a few lines of it.

`torch.optim` imports torch's compiler with its first optimiser: seconds, and where triton is installed its LLVM
crashes the process if a llvmpipe context is open. Training and rendering share a process here.
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor


class Adam:
    """Adam (Kingma and Ba, 2015) with bias correction and without weight decay.

    Args:
        parameters: What is optimised, in place.
        betas: Decay of the mean gradient and of its mean square.
        eps: Added to the root of the mean square.
    """

    def __init__(
        self, parameters: Iterable[Tensor], betas: tuple[float, float] = (0.9, 0.999), eps: float = 1e-8
    ) -> None:
        self._parameters = list(parameters)
        self._betas, self._eps = betas, eps
        self.steps = 0
        self._first = [torch.zeros_like(parameter) for parameter in self._parameters]
        self._second = [torch.zeros_like(parameter) for parameter in self._parameters]

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
        beta1, beta2 = self._betas
        correction1, correction2 = 1.0 - beta1**self.steps, 1.0 - beta2**self.steps
        for parameter, first, second in zip(self._parameters, self._first, self._second, strict=True):
            if parameter.grad is None:
                continue
            first.lerp_(parameter.grad, 1.0 - beta1)
            second.mul_(beta2).addcmul_(parameter.grad, parameter.grad, value=1.0 - beta2)
            root = (second / correction2).sqrt_().add_(self._eps)
            parameter.addcdiv_(first, root, value=-lr / correction1)

    def state(self) -> dict[str, Tensor]:
        """Moments by name; with `steps`, all that `restore` needs."""
        named = {f"first.{i}": tensor for i, tensor in enumerate(self._first)}
        return named | {f"second.{i}": tensor for i, tensor in enumerate(self._second)}

    def restore(self, state: dict[str, Tensor], steps: int) -> None:
        """Continue from a state.

        Args:
            state: What `state` gave.
            steps: Steps that had been done.
        """
        self.steps = steps
        for name, tensor in self.state().items():
            tensor.copy_(state[name])
