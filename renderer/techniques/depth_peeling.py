"""`depth-peeling`: exact. One layer a geometry pass, from the front (Everitt 2001, "Interactive OIT").

Different from the paper: it compares with a second depth buffer, which keeps one of the fragments of equal depth; here
ties are peeled by their colour, repeated ones counted (`renderer.techniques.peeling`). The count pass gives the first
depth, and the occlusion query that ends the loop is a counter of unfinished pixels.
"""

from __future__ import annotations

from renderer.frame import Frame
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.peeling import render_peeled


class DepthPeeling(Technique):
    """Constant memory a pixel, max(n) geometry passes."""

    name = "depth-peeling"
    family = "exact"
    about = "one layer a geometry pass"
    twin = Twin("depth_peeling")

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame exactly. `budget` is not used."""
        return render_peeled(frame, self.name, sides=1)
