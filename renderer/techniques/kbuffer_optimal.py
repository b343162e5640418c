"""`kbuffer-optimal`: k(p) given from outside, as the labeller's certified optimum: the measure of every predictor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from renderer.frame import Frame
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import render_chain

Allocate = Callable[[Frame, Budget], NDArray[np.int32]]
"""Gives k(p), int32 [P], for a frame and a budget."""


class KBufferOptimal:
    """A given allocation.

    Args:
        allocate: Gives the slots of every pixel. The labeller's optimum needs all fragments, so it comes from outside.
    """

    name = "kbuffer-optimal"

    def __init__(self, allocate: Allocate) -> None:
        self._allocate = allocate

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with the given slots."""
        return render_chain(frame, self._allocate(frame, budget), frame.count(), budget)
