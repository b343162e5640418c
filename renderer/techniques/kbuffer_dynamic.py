"""`kbuffer-dynamic`: the k+-buffer (Vasilakis and Fudos 2014): one k for all, the largest that the budget holds.

Where `kbuffer` reserves k slots for every pixel of the window, the k+-buffer counts first and reserves `min(k, n)`: the
histogram of the counts gives the largest k whose slots fit. What the paper does with a max-heap a pixel under a spin
lock is the lock-free chain here; both keep the k nearest.
"""

from __future__ import annotations

from renderer.allocation.dynamic import dynamic
from renderer.frame import Clock, Frame
from renderer.techniques.base import HYBRID, Budget, Rendered, Technique
from renderer.techniques.chain import render_chain


class KBufferDynamic(Technique):
    """The largest k for all pixels that the histogram of depth complexity fits in F."""

    name = "kbuffer-dynamic"
    family = "bounded"
    about = "the largest k for all pixels that F holds"
    twin = HYBRID

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with `min(k, n)` slots everywhere."""
        n = frame.count()
        clock = Clock(frame.ctx)
        with clock.measure("histogram"):
            slots = dynamic(n, budget.fragments)
        rendered = render_chain(frame, slots, n, budget)
        rendered.passes.update(clock.passes)
        return rendered
