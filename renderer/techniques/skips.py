"""Names of what a technique leaves out because the picture is exactly the same without it (METHOD.md section 5)."""

from __future__ import annotations

from renderer.frame import Frame
from renderer.tiles import Tiles

EMPTY_TILES = "empty tiles"
"""Tiles of the window without a transparent fragment: no pass over pixels visits them."""
PREDICTOR = "predictor runs"
"""The budget holds every fragment: nothing is predicted or solved; nor gathered, where N is known by then."""
TAIL = "tails"
"""Every fragment has a slot: no tail is gathered or blended."""
UNREAD_LUMA = "sums of luma that the bundle does not read"
"""Two textures that the pass of the bins leaves out, since no feature of the bundle needs them."""
CULLED_TRIANGLES = "triangles outside the frustum"
"""Triangles whose cluster lies outside of what the camera sees: no pass draws them."""
HIDDEN_FRAGMENTS = "fragments behind opaque surfaces"
"""Fragments that the depth test ended before they were shaded (`renderer.hidden`; a pass of its own counts them)."""


def frame_skips(frame: Frame, tiles: Tiles | None = None) -> dict[str, int]:
    """What every technique leaves out of a frame: empty tiles, triangles outside the frustum.

    Args:
        frame: The view, its picture finished: what is read back here are statistics.
        tiles: Those of the technique; None: those of the frame's count pass, if it has run.
    """
    found = tiles or frame.tiles
    return {EMPTY_TILES: 0 if found is None else found.empty(), CULLED_TRIANGLES: frame.culled_triangles}
