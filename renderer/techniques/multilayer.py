"""`multilayer`: multi-layer alpha blending (Salvi and Vaidyanathan, Multi-Layer Alpha Blending, I3D 2014)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from renderer.frame import Frame
from renderer.techniques.base import Budget, Needs, Rendered, Technique, Twin
from renderer.techniques.ordered import check_nodes, render_ordered


class Multilayer(Technique):
    """A fixed number of blended layers a pixel (MLAB4 with the default of four).

    A layer is a premultiplied colour, a transmittance and a depth. A fragment is inserted in order of depth; when
    there is one layer too many, the two farthest merge: `C = C1 + T1 C2`, `T = T1 T2`, at the nearer one's depth
    (section 3 of the paper). The total transmittance stays exact; colours behind the second farthest layer may be
    composited in the order of their arrival. Equal depths are ordered by the packed colour, as in every technique.

    What differs from the paper: the paper updates the layers in memory inside an ordered critical section (pixel
    synchronisation, now fragment-shader interlock), which few devices have and no software driver. Here the fragments
    are captured with their order of submission and composited in that order with the layers in registers. The picture
    is the same and does not vary between runs; the memory is not: `Rendered` reports the captured fragments, 12 bytes
    each, and beside them as `node_bytes` what a device with interlock needs, 8 bytes a layer (32 bytes per pixel for
    MLAB4: RGBA8 and a float depth).
    Layers hold float32 colours, not RGBA8: nothing is rounded when layers merge.

    Args:
        nodes: Layers a pixel, 1..16.

    Raises:
        Problem: `nodes` is out of range.
    """

    name = "multilayer"
    family = "approximate"
    about = "a few layers; the farthest merge (MLAB)"
    twin = Twin("multilayer", "submitted")

    def __init__(self, nodes: int = 4) -> None:
        self._nodes = check_nodes(self.name, nodes, least=1)

    @classmethod
    def of(cls, needs: Needs) -> Self:
        """See `Technique.of`."""
        return cls() if needs.nodes is None else cls(needs.nodes)

    def parameters(self, frame: Frame) -> Mapping[str, Any]:
        """See `Technique.parameters`."""
        return {"nodes": self._nodes}

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the layers are the budget."""
        return render_ordered(frame, self.name, self._nodes)
