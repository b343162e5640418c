"""`kbuffer-importance`: k(p) from importance maps (Vasilakis et al. 2017, "VKB"), budget filled without waste."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from renderer import timing
from renderer.allocation.fill import budget_fill
from renderer.allocation.importance import VkbOptions, vkb_importance
from renderer.frame import Clock, Frame
from renderer.techniques.base import HYBRID, Budget, Needs, Rendered, Technique
from renderer.techniques.chain import render_chain, render_complete

_FACING_BYTES = 4
"""Of the nearest fragment."""


class KBufferImportance(Technique):
    """Depth complexity, periphery, Fresnel and noise.

    Args:
        options: Which factors, and their constants.
    """

    name = "kbuffer-importance"
    family = "bounded"
    about = "k(p) by importance maps (VKB)"
    twin = HYBRID

    def __init__(self, options: VkbOptions | None = None) -> None:
        self._options = options or VkbOptions()

    @classmethod
    def of(cls, needs: Needs) -> Self:
        """See `Technique.of`."""
        return cls(needs.vkb)

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with slots by importance; none is computed where the budget holds every fragment."""
        n = frame.count()
        complete = render_complete(frame, n, budget)
        if complete is not None:
            return complete
        facing_buffer = frame.gather_facing()
        clock = Clock(frame.ctx)
        with clock.measure("importance"):
            with timing.readback(frame.ctx):
                facing = np.frombuffer(facing_buffer.read(4 * frame.pixels), dtype=np.uint32).astype(np.uint8)
            weights = vkb_importance(n, facing, frame.width, frame.height, self._options)
            slots = budget_fill(weights, n, budget.fragments)
        rendered = render_chain(frame, slots, n, budget, before=_FACING_BYTES)
        return replace(rendered, passes={**frame.passes("facing"), **clock.passes, **rendered.passes})
