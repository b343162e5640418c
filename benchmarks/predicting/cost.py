"""What a predictor costs a pixel."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from renderer.allocation.gpu import CURVE_BYTES
from renderer.bin_pass import Binned
from renderer.features import reads_colours
from renderer.techniques.chain import OFFSET_BYTES, SLOT_BYTES
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
        gather_bytes: All that is alive while bins and colours are gathered and the network runs. There is no pool yet.
        capture_bytes: All that is alive while fragments are captured.
    """

    weights: int
    multiply_adds: int
    gather_bytes: int
    capture_bytes: int

    def peak_bytes(self, multiple: float) -> float:
        """Bytes a pixel, the pool included, of the fullest moment of a frame at F = W H times `multiple`."""
        return max(self.gather_bytes, self.capture_bytes + SLOT_BYTES * multiple)


def network_cost(weights: Weights, tail: TailName) -> Cost:
    """Of `kbuffer-deep` with a network.

    Args:
        weights: The network.
        tail: That the frame uses.
    """
    row = TAILS[tail]
    colours = [_STAND_IN, _STAND_IN] if reads_colours(weights.features) else []
    gathered = Binned(tail, row, [], _STAND_IN, _STAND_IN, colours)
    captured = Binned(tail, row, [], _STAND_IN, _STAND_IN, [])
    return Cost(
        weights=sum(weight.size + bias.size for weight, bias in weights.layers),
        multiply_adds=sum(weight.size for weight, _ in weights.layers),
        gather_bytes=max(gathered.gathered_bytes, gathered.kept_bytes + CURVE_BYTES),
        capture_bytes=captured.kept_bytes + OFFSET_BYTES + row.sum_bytes,
    )
