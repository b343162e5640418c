"""`kbuffer-importance`: k(p) from importance maps (Vasilakis et al. 2017, "VKB"), budget filled without waste."""

from __future__ import annotations

import numpy as np

from renderer import timing
from renderer.allocation.fill import budget_fill
from renderer.allocation.importance import VkbOptions, vkb_importance
from renderer.frame import Clock, Frame
from renderer.techniques.base import Budget, Rendered
from renderer.techniques.chain import RANGE_BYTES, render_chain, render_complete
from schemas.tail import DENSITY_BINS


class KBufferImportance:
    """Depth complexity, periphery, Fresnel and noise.

    Args:
        options: Which factors, and their constants.
    """

    name = "kbuffer-importance"

    def __init__(self, options: VkbOptions | None = None) -> None:
        self._options = options or VkbOptions()

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with slots by importance; none is computed where the budget holds every fragment."""
        n = frame.count()
        complete = render_complete(frame, n, budget)
        if complete is not None:
            return complete
        gathered = frame.gather("gather-nearest", bins=DENSITY_BINS.get(budget.tail, 0))
        assert gathered.nearest_facing is not None, "this gather has the nearest fragment"
        clock = Clock(frame.ctx)
        with clock.measure("importance"):
            with timing.readback(frame.ctx):
                read = np.frombuffer(gathered.nearest_facing.read(4 * frame.pixels), dtype=np.uint32)
            facing = read.astype(np.uint8)
            weights = vkb_importance(n, facing, frame.width, frame.height, self._options)
            slots = budget_fill(weights, n, budget.fragments)
        before = RANGE_BYTES + gathered.pass_bytes
        rendered = render_chain(frame, slots, n, budget, frame.retire(gathered), before)
        rendered.passes.update(clock.passes)
        return rendered
