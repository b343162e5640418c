"""`dual-depth-peeling`: exact. The nearest and the farthest layer a geometry pass (Bavoil and Myers 2008).

Different from the paper: it keeps (-nearest, farthest) in one target with MAX blending, and one of the fragments of
equal depth; here both are atomic minima of keys, and ties are peeled by colour, repeated ones counted
(`renderer.techniques.peeling`). What was peeled from the front and from the back is composited apart and joined at the
end: front + (1 - coverage) * (back over the background).
"""

from __future__ import annotations

from renderer.frame import Frame
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.peeling import render_peeled


class DualDepthPeeling(Technique):
    """Constant memory a pixel, about max(n) / 2 geometry passes."""

    name = "dual-depth-peeling"
    family = "exact"
    about = "nearest and farthest layer a geometry pass"
    twin = Twin("dual_depth_peeling")

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used."""
        return render_peeled(frame, self.name, sides=2)
