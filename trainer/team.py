"""The processes that train one network together; `trainer.distributed` has those of torchrun."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from torch import Tensor


class Team(Protocol):
    """Processes that take the same steps, each with its share of every batch.

    Attributes:
        rank: Of this process, 0..size-1; the first one writes files.
        size: How many there are.
    """

    @property
    def rank(self) -> int:
        """Of this process."""

    @property
    def size(self) -> int:
        """How many there are."""

    def add(self, tensors: Sequence[Tensor]) -> None:
        """Replaces every tensor by its sum over all processes."""

    def agreed(self, value: float) -> float:
        """The value of the first process, in all of them."""


class Alone:
    """One process."""

    rank: int = 0
    size: int = 1

    def add(self, tensors: Sequence[Tensor]) -> None:
        """Nobody to add to."""

    def agreed(self, value: float) -> float:
        """The value."""
        return value
