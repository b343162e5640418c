"""How many pixels two pictures agree in, and which of the others neighbours explain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.judging.seen import Seen
from renderer.usd.materials import GREY
from schemas.colour import linear_to_srgb

COLOUR = 6.0 / 255.0
"""sRGB values that colours may differ by: both are stored in 8 bits or half floats, and textures are filtered."""
ALPHA = 3.0 / 255.0
"""What opacities may differ by."""
STORM_GREY = 0.5
"""Linear RGB of what has no colour in Storm."""
DEPTH = 2e-4
"""Of the scene's diagonal: what depths may differ by."""
Mask = NDArray[np.bool_]
Plane = NDArray[np.float64]


@dataclass(slots=True)
class Count:
    """Pixels of some pictures.

    Attributes:
        pixels: That one of both covers.
        equal: Of them, those that agree.
        edge: That do not, but whose value is between those of the other's neighbours.
        unset: Whose surfaces have no colour, and are shown in each renderer's own grey.
    """

    pixels: int = 0
    equal: int = 0
    edge: int = 0
    unset: int = 0

    @property
    def unexplained(self) -> int:
        """The others."""
        return self.pixels - self.equal - self.edge - self.unset

    def add(self, other: Count) -> None:
        """Sum it up."""
        self.pixels += other.pixels
        self.equal += other.equal
        self.edge += other.edge
        self.unset += other.unset


@dataclass(frozen=True, slots=True)
class Agreement:
    """Two pictures compared.

    Attributes:
        counts: By what is compared.
        wrong: bool [H, W], where anything is unexplained.
    """

    counts: dict[str, Count]
    wrong: Mask


def shape_agreement(here: Seen, there: Seen, diagonal: float, clip: tuple[float, float]) -> Agreement:
    """Silhouettes and depths.

    Args:
        here: As loaded here.
        there: In Storm.
        diagonal: Of the scene's bounds, stage units.
        clip: Near and far, stage units.
    """
    either = here.covered | there.covered
    cover = _judged(here.covered.astype(float), there.covered.astype(float), 0.5, either)
    # Where nothing is, depth is so far that no tolerance reaches it, and yet a number that neighbours can enclose.
    far = 1e3 * diagonal
    depths = [np.where(np.isfinite(each.depth), each.depth, far).astype(np.float64) for each in (here, there)]
    # A step of a depth buffer with 24 bits, where it is coarsest: of a perspective one.
    step = np.minimum(depths[0], depths[1]) ** 2 * (1.0 / clip[0] - 1.0 / clip[1]) * 2.0**-24
    tolerance = DEPTH * diagonal + np.where(step < diagonal, 2.0 * step, 0.0)
    depth = _judged(depths[0], depths[1], tolerance, np.isfinite(here.depth) | np.isfinite(there.depth))
    return Agreement({"silhouette": cover[0], "depth": depth[0]}, cover[1] | depth[1])


def look_agreement(here: Seen, there: Seen) -> Agreement:
    """Colours and opacities, where both have anything; where only one has, is for `shape_agreement`."""
    both = here.covered & there.covered
    alpha = _judged(here.rgba[..., 3].astype(float), there.rgba[..., 3].astype(float), ALPHA, both, filtered=True)
    shades = [linear_to_srgb(each.rgba[..., :3]) for each in (here, there)]
    colour, wrong = _judged(shades[0], shades[1], COLOUR, both, filtered=True)
    unset = wrong & _is_grey(here, GREY[0]) & _is_grey(there, STORM_GREY)
    colour.unset = int(unset.sum())
    return Agreement({"opacity": alpha[0], "colour": colour}, alpha[1] | wrong & ~unset)


def _is_grey(seen: Seen, value: float) -> Mask:
    grey = np.abs(seen.rgba[..., :3] - value * seen.rgba[..., 3:]).max(axis=2) < 0.01
    return np.asarray(grey & (seen.rgba[..., 3] > 0.0))


def _judged(
    here: Plane, there: Plane, tolerance: float | Plane, where: Mask, filtered: bool = False
) -> tuple[Count, Mask]:
    """Compare values; those of filtered textures may lie between neighbours in one of both pictures only."""
    equal = _every(np.abs(here - there) <= tolerance)
    among = _every(_among(here, there, tolerance)), _every(_among(there, here, tolerance))
    edge = (among[0] | among[1] if filtered else among[0] & among[1]) & ~equal
    wrong = where & ~equal & ~edge
    return Count(int(where.sum()), int((where & equal).sum()), int((where & edge).sum())), wrong


def _among(value: Plane, other: Plane, tolerance: float | Plane) -> Mask:
    """Where a value lies between the least and the greatest of the other's 3x3 pixels there."""
    height, width = other.shape[:2]
    padded = np.pad(other, [(1, 1), (1, 1), (0, 0)][: other.ndim], mode="edge")
    near = [padded[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    least, most = np.minimum.reduce(near), np.maximum.reduce(near)
    return np.asarray((value >= least - tolerance) & (value <= most + tolerance))


def _every(mask: Mask) -> Mask:
    return np.asarray(mask.all(axis=2)) if mask.ndim == 3 else mask
