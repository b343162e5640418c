"""`binned`: a binned tail and nothing else, an atomic and an additive pass (METHOD.md 2).

The first pass gathers depth bins, one atomic a fragment, the second weighs every fragment by what they know to be in
front of it. There are no slots, no order of fragments, and no network. `kbuffer-deep` is this with a core.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from renderer.frame import Clock, Frame
from renderer.techniques.base import HYBRID, Budget, Rendered, Technique
from renderer.techniques.chain import TailInputs, tail_targets
from renderer.techniques.sums import rendered, resolve_mean
from schemas.tail import MOST_OPACITY, TAILS, TailName

DEFAULT_BINS: Final[TailName] = "binned-16"


class Binned(Technique):
    """Order-independent transparency by depth bins.

    Args:
        tail: A tail with bins.
    """

    name = "binned"
    family = "approximate"
    about = "a mean weighted by what depth bins know to be in front"
    twin = HYBRID

    def __init__(self, tail: TailName = DEFAULT_BINS) -> None:
        self._tail = tail

    def parameters(self, frame: Frame) -> Mapping[str, Any]:
        """See `Technique.parameters`."""
        return {"tail": self._tail}

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: what is kept of a pixel does not depend on its fragments."""
        binned = frame.kept_bins(self._tail)
        tail = TailInputs(TAILS[self._tail], binned=binned)
        clock = Clock(frame.ctx)
        with clock.measure("tail"):
            colours, depths = tail_targets(frame, tail)
            target = frame.target([colours, depths])
            frame.draw_transparent("binned/tail.frag", target, tail.defines, **tail.bind())
        with clock.measure("resolve"):
            image = resolve_mean(frame, colours, depths, MOST_OPACITY)
        shared = frame.passes("opaque", "range", "bins")
        return rendered(frame, image, shared, clock, tail.pixel_bytes)
