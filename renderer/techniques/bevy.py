"""`bevy`: the lists of Bevy's order-independent transparency, eight sorted, the rest blended early."""

from __future__ import annotations

from renderer.frame import Frame
from renderer.techniques.base import Budget, Rendered, Technique, Twin
from renderer.techniques.ordered import EnginePool, render_ordered

NODES = 8
"""The engine's default `sorted_fragment_max_count`."""

POOL = EnginePool(slots=4, pixel_bytes=4 * 12 + 4)
"""The default `fragments_per_pixel_average`; a node is a colour, a depth with opacity and an index, a head one word: 52
bytes per pixel."""


class Bevy(Technique):
    """What Bevy 0.20 does with its defaults, on the fragments of this renderer.

    Read in Bevy (`crates/bevy_core_pipeline/src/oit/draw.wesl` and `resolve/oit_resolve.wesl`): a fragment takes the
    next node of a pool of 4 W H nodes, or is lost where the pool is full ("TODO for tail blending"). Resolving walks a
    pixel's list from the newest fragment and keeps eight sorted, nearest first. With one too many, the nearest of the
    nine is composited at once, behind what already is; at the end the eight follow. So the farthest eight are in order,
    and the nearer ones in the order in which they were pushed out. Of equal depths the more opaque one is nearer, since
    both share a word.

    What differs from the engine: colours are 8-bit and depths float32, where Bevy has a shared exponent and 24 bits of
    reversed depth. Fragments behind opaque surfaces take no node; in Bevy they do, unless there is a depth prepass.
    Light that is composited early is multiplied by its opacity once, as what is composited last. Fragments arrive in
    the order of the stage's triangles (`renderer.techniques.arrivals`); Bevy draws meshes from back to front, sorted by
    their centres. `k` counts the fragments of a list that are sorted if none is lost.
    """

    name = "bevy"
    family = "approximate"
    about = "Bevy's lists: 8 sorted, overflow lost"
    twin = Twin("bevy", "submitted", POOL.slots)

    def render(self, frame: Frame, budget: Budget) -> Rendered:
        """Render a frame. `budget` is not used: the pool is the engine's."""
        return render_ordered(frame, self.name, NODES, POOL)
