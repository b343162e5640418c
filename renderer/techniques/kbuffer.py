"""`kbuffer`: one k for every pixel of the window (Bavoil et al. 2007), with a tail."""

from __future__ import annotations

import numpy as np

from renderer.frame import Frame
from renderer.techniques.base import HYBRID, Budget, Rendered, Technique
from renderer.techniques.chain import render_chain


class KBuffer(Technique):
    """Fixed k = floor(F / (W H)); a pixel's unused slots stay empty, as in a fixed array.

    No more slots than the fullest pixel has fragments: the others would be empty everywhere.
    """

    name = "kbuffer"
    family = "bounded"
    about = "the same k for every pixel of the window"
    twin = HYBRID

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame with the same number of slots everywhere."""
        n = frame.count()
        k = min(budget.fragments // frame.pixels, int(n.max()))
        slots = np.full(frame.pixels, k, dtype=np.int32)
        return render_chain(frame, slots, n, budget)
