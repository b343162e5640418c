"""`kbuffer-optimal`: k(p) given from outside, as the labeller's certified optimum: the measure of every predictor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.frame import Frame
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import render_chain


class KBufferOptimal:
    """A given allocation.

    Args:
        k: int32 [P], slots of every pixel.
    """

    name = "kbuffer-optimal"

    def __init__(self, k: NDArray[np.int32]) -> None:
        self._k = k

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with the given slots."""
        return render_chain(frame, self._k, frame.count(), budget)
