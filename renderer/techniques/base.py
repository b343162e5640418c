"""What every technique takes and gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from renderer.frame import Frame
from schemas.tail import DENSITY_G, TailName


@dataclass(frozen=True, slots=True)
class Budget:
    """How much a technique may spend, and how it fills in the rest.

    Attributes:
        fragments: F, slots of 8 bytes in the fragment pool.
        tail: How fragments beyond the core are approximated (METHOD.md section 2).
        g: The density tail's constant.
    """

    fragments: int
    tail: TailName = "density"
    g: float = DENSITY_G


@dataclass(frozen=True, slots=True)
class Rendered:
    """A finished picture.

    Attributes:
        linear: float32 [H, W, 3], linear RGB, row 0 at the top.
        k: int32 [P], core fragments each pixel was allotted (clipped to n).
        passes: Milliseconds of each pass, in order; shared passes (opaque, count, gather) as first measured.
        captured: Core fragments stored.
        pool_bytes: Bytes of the fragment pool.
        total_bytes: Pool and all per-pixel buffers that live at the same time.
        skipped: What was not needed, in words; empty if nothing.
    """

    linear: NDArray[np.float32]
    k: NDArray[np.int32]
    passes: dict[str, float]
    captured: int
    pool_bytes: int
    total_bytes: int
    skipped: tuple[str, ...] = ()

    @property
    def milliseconds(self) -> float:
        """Sum of the passes."""
        return sum(self.passes.values())


class Technique(Protocol):
    """A way to render transparency."""

    name: str

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame within a budget."""
        ...
