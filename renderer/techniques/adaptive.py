"""`adaptive`: adaptive transparency (Salvi, Montgomery and Lefohn, Adaptive Transparency, HPG 2011)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from renderer.frame import Frame
from renderer.techniques.base import Budget, Needs, Rendered, Technique, Twin
from renderer.techniques.ordered import check_nodes, render_ordered


class Adaptive(Technique):
    """The visibility function of every pixel, compressed to a few steps; all fragments composited with it.

    As the paper does on hardware without ordered access (section 4): fragments are captured, one loop over a pixel's
    fragments builds a step function of at most M nodes (depth, transmittance behind it), a second one sums
    `C = sum c_i a_i V(z_i) + V(infinity) * background`. An insertion multiplies every node behind it by `1 - a`. With
    one node too many, the inner node goes whose removal changes the area under the curve least,
    `(z_i - z_(i-1)) (T_(i-1) - T_i)`, and its transmittance moves to the node in front of it. The curve is therefore
    never above the exact one, and no picture is brighter than the exact one; the first and the last node always stay,
    so the total transmittance is exact.

    What differs from the paper: lists are contiguous and in the order of submission instead of linked and in any
    order, so that pictures do not vary between runs. Equal depths are ordered by the packed colour, as in every
    technique, where in the paper each of them sees the same visibility: that makes light (more than all of it for many
    coincident surfaces). Here they enclose no area, so their nodes go first, and all but the first of them are then
    dimmed by the whole group. Memory is that of the captured fragments; with
    interlock and a second geometry pass it would be the nodes, 8 bytes each: depth and transmittance (`node_bytes`).

    Args:
        nodes: Nodes of the visibility function, 2..16.

    Raises:
        Problem: `nodes` is out of range.
    """

    name = "adaptive"
    family = "approximate"
    about = "visibility in a few steps (Salvi)"
    twin = Twin("adaptive", "submitted")

    def __init__(self, nodes: int = 8) -> None:
        self._nodes = check_nodes(self.name, nodes, least=2)

    @classmethod
    def of(cls, needs: Needs) -> Self:
        """See `Technique.of`."""
        return cls() if needs.nodes is None else cls(needs.nodes)

    def parameters(self, frame: Frame) -> Mapping[str, Any]:
        """See `Technique.parameters`."""
        return {"nodes": self._nodes}

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the nodes are the budget."""
        return render_ordered(frame, self.name, self._nodes)
