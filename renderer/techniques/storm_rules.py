"""`storm-rules`: the lists of OpenUSD's Storm, of which a pixel's last eight fragments are read."""

from __future__ import annotations

from renderer.frame import Frame
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.ordered import EnginePool, render_ordered

NODES = 8
"""`maxSamples` of `oitResolveImageShader.glslfx`, which is also the pool's nodes per pixel."""

POOL = EnginePool(slots=8, pixel_bytes=8 * (16 + 4 + 4) + 4)
"""A node is RGBA32F, a float depth and an index; a pixel's head is one word: 196 bytes per pixel."""


class StormRules(Technique):
    """What Storm, Hydra's rasteriser, does with transparent fragments, on the fragments of this renderer.

    Read in OpenUSD (`pxr/imaging/hdx/shaders/renderPass.glslfx`, `WriteOitLayersToBufferCommon`, and
    `oitResolveImageShader.glslfx`; the buffers in `oitBufferAccessor.cpp`): a fragment takes the next node of a pool of
    8 W H nodes and becomes the head of its pixel's list; where the pool is full, it is lost. Resolving walks the list
    from its head, the newest fragment, and stops after eight. Those are sorted by depth, of equal depths the newest
    first, and composited. So in a pixel of more than eight fragments those that were drawn first are missing, however
    near they are, and with them their share of the opacity.

    What differs from the engine: colours are those of this renderer, 8-bit, where Storm's are float and lit by itself.
    Fragments arrive in the order of the stage's triangles (`renderer.techniques.arrivals`); Storm draws batches that it
    puts together by material and buffer, so its order is another one, and no less arbitrary. `k` counts the fragments
    of a list that are read if none is lost.
    """

    name = "storm-rules"
    family = "approximate"
    about = "Storm's lists: the last 8, overflow lost"
    twin = Twin("storm_rules", "submitted", POOL.slots)

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the pool is the engine's."""
        return render_ordered(frame, self.name, NODES, POOL)
