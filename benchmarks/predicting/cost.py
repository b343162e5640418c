"""What a predictor costs a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from renderer.bin_pass import Binned
from renderer.features import reads_luma
from renderer.techniques.chain import SLOT_BYTES
from schemas.tail import TAILS, TailName
from trainer.weights import Weights

_STAND_IN: Final[Any] = object()
"""A texture or buffer, as far as the account of bytes goes: nothing of it is on a GPU."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What a pixel costs, the pool of fragments aside.

    Attributes:
        weights: Numbers of the network.
        multiply_adds: Of one run of it.
        early_bytes: A pixel's words and the tail's sums: the pool lies in the words as long as they have room.
        free_slots: Slots of the pool that there is room for.
    """

    weights: int
    multiply_adds: int
    early_bytes: int
    free_slots: int

    def peak_bytes(self, multiple: float) -> float:
        """Bytes a pixel, the pool included, of the fullest moment of a frame at F = W H times `multiple`."""
        if multiple <= self.free_slots:
            return self.early_bytes
        return self.early_bytes + SLOT_BYTES * multiple


def network_cost(weights: Weights, tail: TailName) -> Cost:
    """Of `kbuffer-deep` with a network.

    Args:
        weights: The network.
        tail: That the frame uses.
    """
    row = TAILS[tail]
    binned = Binned(tail, row, _STAND_IN, 1, _STAND_IN, reads_luma(weights.features))
    return Cost(
        weights=sum(weight.size + bias.size for weight, bias in weights.layers),
        multiply_adds=sum(weight.size for weight, _ in weights.layers),
        early_bytes=binned.pixel_bytes + row.sum_bytes,
        free_slots=binned.free_slots,
    )
