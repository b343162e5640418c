"""Where along a pixel's depth its optical depth lies: what the binned tails keep (METHOD section 2), compiled.

The bins are equal in `y = .4 x + .6 sqrt(x)`, x the depth between the nearest and the farthest fragment of the pixel's
tile. Places are found in float32 with the operations of `shaders/common/depth_bins.glsl`, and bins count in whole
units, so that what is kept of them is the same here and there, whatever the order of the fragments.
`labeller.reference.binned_exponents` is the plain twin.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from renderer.tile_range import pixel_ranges
from schemas.fragments import FragmentDump
from schemas.tail import (
    BIN_LIMIT,
    COUNT_LIMIT,
    LEAST_OTHERS,
    LEAST_SPREAD,
    MOST_BINS,
    OPTICAL_UNIT,
    PLAIN_SHARE,
    ROOT_SHARE,
    TAILS,
    Tail,
    TailName,
)

OPTICAL: Final = -np.log(np.maximum(1.0 - np.arange(256) / 255.0, 1e-3))
"""`-ln(1 - a)` of the stored alphas; 255 is never in a dump, and kept finite."""
UNITS: Final = np.maximum(np.round(OPTICAL * OPTICAL_UNIT), np.arange(256) > 0)
"""The same in the units that depth bins count in; whole numbers, 1 at least where there is any."""
_ROOT: Final = np.float32(ROOT_SHARE)
_PLAIN: Final = np.float32(PLAIN_SHARE)
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)


class BinForm(NamedTuple):
    """What of a tail's bins compiled code has to know.

    Attributes:
        bins: B; 0: the tail has none.
        share_levels: Steps in which shares are kept.
        mean_levels: Steps in which means are kept; 0: none are.
    """

    bins: int
    share_levels: int
    mean_levels: int


class Kept(NamedTuple):
    """What is kept of one pixel's bins, and the room to find it.

    Attributes:
        front: float64 [B+1], share of the optical depth in front of each bin, and 1 (0 where there is none).
        mean: float64 [B], mean position in each bin, 0 to 1; one half where it is not kept, as of the last one.
    """

    front: NDArray[np.float64]
    mean: NDArray[np.float64]


def bin_form(tail: Tail) -> BinForm:
    """Of a row of the table of tails."""
    return BinForm(tail.bins, tail.share_levels, tail.mean_levels)


@njit(inline="always")
def kept_room() -> Kept:
    """Room for any tail's bins."""
    return Kept(np.zeros(MOST_BINS + 1), np.zeros(MOST_BINS))


@njit(inline="always")
def place_of(z: np.float32, nearest: np.float32, extent: np.float32, bins: int) -> np.float32:
    """Bin and position in it, as one number in [0, bins].

    Args:
        z: Depth of a fragment; what lies outside of the range counts as at its end.
        nearest: Where the bins begin.
        extent: From there to their end, >= 0.
        bins: B.
    """
    x = (z - nearest) / extent if extent > _ZERO else _ZERO
    x = min(max(x, _ZERO), _ONE)
    return (_PLAIN * x + _ROOT * np.float32(math.sqrt(x))) * np.float32(bins)


@njit(inline="always")
def nearest_level(part: float, whole: float, steps: int) -> float:
    """What is kept of `part / whole`, whole numbers: the nearest multiple of 1 / steps, at most 1."""
    return min(math.floor((2 * steps * part + whole) / (2.0 * whole)), steps) / steps


@njit(inline="always")
def keep_bins(
    form: BinForm,
    depth: NDArray[np.float32],
    rgba: NDArray[np.uint8],
    nearest: np.float32,
    extent: np.float32,
    kept: Kept,
) -> float:
    """Find what is kept of a list's bins.

    Args:
        form: Of the tail.
        depth: float32 [n], ascending, n > 0.
        rgba: uint8 [n, 4].
        nearest: Where the bins begin.
        extent: From there to their end.
        kept: Gets the result.

    Returns:
        The optical depth as it is kept: whole units, at most BIN_LIMIT a bin.
    """
    bins, front, mean = form.bins, kept.front, kept.mean
    front[: bins + 1] = 0.0
    mean[:bins] = 0.0
    for i in range(len(depth)):
        place = place_of(depth[np.uint64(i)], nearest, extent, bins)
        b = min(int(place), bins - 1)
        units = UNITS[rgba[np.uint64(i), 3]]
        front[b + 1] += units
        mean[b] += math.floor(np.float32(units) * (place - np.float32(b)) + np.float32(0.5))
    for b in range(bins):
        own = min(front[b + 1], BIN_LIMIT)
        if form.mean_levels == 0 or b == bins - 1:
            mean[b] = 0.5
        elif own > 0.0:
            mean[b] = nearest_level(min(mean[b], BIN_LIMIT), own, form.mean_levels)
        front[b + 1] = front[b] + own
    total = front[bins]
    for b in range(bins + 1):
        front[b] = nearest_level(front[b], total, form.share_levels) if total > 0.0 else 0.0
    return float(total)


@njit(inline="always")
def in_front_of(optical: float, own: float, place: np.float32, b: int, kept: Kept) -> float:
    """Optical depth in front of a fragment, as far as what is kept of its pixel's bins knows.

    The other fragments of its bin are taken to be spread evenly around their mean, as far as the bin reaches on its
    nearer side: alone in its bin, a fragment's exponent is exact but for the steps in which shares are kept.

    Args:
        optical: D, of all fragments.
        own: That of the fragment.
        place: Of the fragment, from `place_of`.
        b: Its bin.
        kept: Of its pixel.
    """
    before = optical * kept.front[b]
    within = optical * kept.front[b + 1] - before
    others = max(within - own, 0.0)
    s = np.float64(place) - b
    middle = 0.5
    if others > LEAST_OTHERS:
        middle = min(max((within * kept.mean[b] - own * s) / others, 0.0), 1.0)
    half = max(min(middle, 1.0 - middle), LEAST_SPREAD)
    return float(before + others * min(max((s - (middle - half)) / (2.0 * half), 0.0), 1.0))


@njit(cache=True, error_model="numpy")
def binned_exponents(
    form: BinForm,
    depth: NDArray[np.float32],
    rgba: NDArray[np.uint8],
    nearest: np.float32,
    extent: np.float32,
    kept: Kept,
    out: NDArray[np.float64],
) -> None:
    """Optical depth of a list in front of each fragment, as far as what is kept of its bins knows.

    Args:
        form: Of the tail.
        depth: float32 [n], ascending, n > 0.
        rgba: uint8 [n, 4].
        nearest: Where the bins begin.
        extent: From there to their end.
        kept: Room.
        out: float64 [n].
    """
    optical = keep_bins(form, depth, rgba, nearest, extent, kept) / OPTICAL_UNIT
    for i in range(len(depth)):
        place = place_of(depth[np.uint64(i)], nearest, extent, form.bins)
        b = min(int(place), form.bins - 1)
        out[np.uint64(i)] = in_front_of(optical, OPTICAL[rgba[np.uint64(i), 3]], place, b, kept)


def bin_counts(dump: FragmentDump, name: TailName) -> NDArray[np.uint8]:
    """Fragments of each depth bin of every pixel, as a frame counts them.

    Args:
        dump: Fragments of a view.
        name: A tail with bins.

    Returns:
        uint8 [P, MOST_BINS], `COUNT_LIMIT` for that many or more, 0 where the tail has no such bin.
    """
    counts, ranges = np.zeros((dump.pixels, MOST_BINS), dtype=np.uint8), pixel_ranges(dump)
    _count_bins(TAILS[name].bins, dump.offsets, dump.depth, ranges.nearest, ranges.extent, counts)
    return counts


@njit(parallel=True, cache=True)
def _count_bins(
    bins: int,
    offsets: NDArray[np.int64],
    depth: NDArray[np.float32],
    nearest: NDArray[np.float32],
    extent: NDArray[np.float32],
    counts: NDArray[np.uint8],
) -> None:
    for p in prange(len(offsets) - 1):
        for i in range(offsets[p], offsets[p + 1]):
            b = min(int(place_of(depth[i], nearest[p], extent[p], bins)), bins - 1)
            if counts[p, b] < COUNT_LIMIT:
                counts[p, b] += 1
