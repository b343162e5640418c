"""`kbuffer-optimal`: k(p) given from outside, as the labeller's certified optimum: the measure of every predictor."""

from __future__ import annotations

from typing import Self

from renderer.frame import Frame
from renderer.techniques.base import HYBRID, Allocate, Budget, Needs, Rendered, Technique
from renderer.techniques.chain import render_chain
from schemas.problem import Problem


class KBufferOptimal(Technique):
    """A given allocation.

    Args:
        allocate: Gives the slots of every pixel. The labeller's optimum needs all fragments, so it comes from outside.
    """

    name = "kbuffer-optimal"
    family = "bounded"
    about = "k(p) as allocated with all fragments known"
    twin = HYBRID

    def __init__(self, allocate: Allocate) -> None:
        self._allocate = allocate

    @classmethod
    def of(cls, needs: Needs) -> Self:
        """See `Technique.of`."""
        if needs.allocate is None:
            raise Problem(f"{cls.name} needs an allocation.", "Give one with `Needs(allocate=...)`.")
        return cls(needs.allocate)

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with the given slots."""
        return render_chain(frame, self._allocate(frame, budget), frame.count(), budget)
