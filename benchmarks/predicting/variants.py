"""The predictors that are trained and scored: every size of network with every tail that a bundle can be made for."""

from __future__ import annotations

from dataclasses import dataclass

from schemas.network import SIZES, NetworkSize
from schemas.tail import BINNED_TAILS, TailName
from trainer.config import TrainConfig


@dataclass(frozen=True, slots=True)
class Variant:
    """A predictor.

    Attributes:
        size: Of its network.
        tail: That it is trained for and frames use.
        config: How it is trained.
    """

    size: NetworkSize
    tail: TailName
    config: TrainConfig

    @property
    def name(self) -> str:
        """Of the row in the tables."""
        return f"{self.size}, {self.tail}"


def variants() -> dict[str, Variant]:
    """All of them by name, in the order of the tables."""
    every = [Variant(size, tail, TrainConfig.sized(size)) for tail in BINNED_TAILS for size in SIZES]
    return {variant.name: variant for variant in every}
