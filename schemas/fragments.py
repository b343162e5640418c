"""The fragment dump of one view: every transparent fragment, exactly, in CSR form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class FragmentDump:
    """All transparent fragments of a view. Pixel index `p = y * width + x`, row 0 at the top.

    Fragments of a pixel are front to back; equal depths are ordered by the packed colour, so that a dump is
    identical from run to run. Fragments behind opaque geometry, of stored alpha 0 (they show nothing) or 255
    (they are opaque: part of `background`) are never stored.

    Attributes:
        width: Pixels per row.
        height: Rows.
        offsets: int64 [P+1] with P = width*height; fragments of pixel p are `offsets[p]:offsets[p+1]`.
        rgba: uint8 [N, 4], straight alpha; RGB gamma-2 encoded (schemas.colour), alpha linear.
        depth: float32 [N], view-space distance along the view axis, metres, > 0.
        background: uint8 [P, 3], gamma-2 encoded colour of what lies behind: opaque geometry or the clear colour.
        facing: uint8 [P], |n . e| * 255 of the nearest transparent fragment (VKB's Fresnel factor); 0 where none.
        tile_range: float32 [T, 2], depths between which the depth bins of each tile's pixels lie, as the renderer found
            them (`renderer.tile_range`), tiles of `schemas.tail.RANGE_TILE` squared pixels by rows; None: those of the
            tile's nearest and farthest fragment.
    """

    width: int
    height: int
    offsets: NDArray[np.int64]
    rgba: NDArray[np.uint8]
    depth: NDArray[np.float32]
    background: NDArray[np.uint8]
    facing: NDArray[np.uint8]
    tile_range: NDArray[np.float32] | None = None

    @property
    def pixels(self) -> int:
        """P = width * height."""
        return self.width * self.height

    @property
    def total(self) -> int:
        """N, the number of fragments."""
        return len(self.depth)

    @property
    def counts(self) -> NDArray[np.int64]:
        """int64 [P], n(p)."""
        return np.diff(self.offsets)
