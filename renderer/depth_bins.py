"""Where along a pixel's depth its optical depth lies: the binned density tail's account (METHOD section 2), compiled.

The bins are equal in `y = .4 x + .6 sqrt(x)`, x the depth between the pixel's nearest and farthest fragment. Places are
found in float32 with the operations of `shaders/common/depth_bins.glsl`, and bins count in whole units, so that what is
kept of them is the same here and there, whatever the order of the fragments.
`labeller.reference.binned_exponents` is the plain twin.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from schemas.tail import BIN_LIMIT, OPTICAL_UNIT, PLAIN_SHARE, ROOT_SHARE, SHARE_LEVELS

MOST_BINS: Final = 16
OPTICAL: Final = -np.log(np.maximum(1.0 - np.arange(256) / 255.0, 1e-3))
"""`-ln(1 - a)` of the stored alphas; 255 is never in a dump, and kept finite."""
UNITS: Final = np.maximum(np.round(OPTICAL * OPTICAL_UNIT), np.arange(256) > 0)
"""The same in the units that depth bins count in; whole numbers, 1 at least where there is any."""
_ROOT: Final = np.float32(ROOT_SHARE)
_PLAIN: Final = np.float32(PLAIN_SHARE)
_ZERO: Final = np.float32(0.0)


@njit(inline="always")
def place_of(z: np.float32, nearest: np.float32, extent: np.float32, bins: int) -> np.float32:
    """Bin and position in it, as one number in [0, bins].

    Args:
        z: Depth of a fragment.
        nearest: That of the pixel's nearest one.
        extent: From there to the farthest one, >= 0.
        bins: B, a power of two.
    """
    x = (z - nearest) / extent if extent > _ZERO else _ZERO
    return (_PLAIN * x + _ROOT * np.float32(math.sqrt(x))) * np.float32(bins)


@njit(inline="always")
def kept_share(front: float, total: float) -> float:
    """What is kept of the share `front / total` of whole units: the nearest multiple of 1 / SHARE_LEVELS."""
    return math.floor((2 * SHARE_LEVELS * front + total) / (2.0 * total)) / SHARE_LEVELS if total > 0.0 else 0.0


@njit(inline="always")
def units_in_front(depth: NDArray[np.float32], rgba: NDArray[np.uint8], front: NDArray[np.float64]) -> None:
    """Units of a list's optical depth in front of each bin, and of all of it.

    Args:
        depth: float32 [n], ascending, n > 0.
        rgba: uint8 [n, 4].
        front: float64 [B+1], the result: whole numbers.
    """
    n, bins = len(depth), len(front) - 1
    nearest, extent = depth[0], depth[n - 1] - depth[0]
    front[:] = 0.0
    for i in range(n):
        place = place_of(depth[np.uint64(i)], nearest, extent, bins)
        front[min(int(place), bins - 1) + 1] += UNITS[rgba[np.uint64(i), 3]]
    for b in range(bins):
        front[b + 1] = front[b] + min(front[b + 1], BIN_LIMIT)


@njit(cache=True, error_model="numpy")
def binned_exponents(
    depth: NDArray[np.float32],
    rgba: NDArray[np.uint8],
    optical: float,
    front: NDArray[np.float64],
    out: NDArray[np.float64],
) -> None:
    """Optical depth of a list in front of each fragment, as far as what is kept of its bins knows.

    Fragments of a bin are taken to be spread evenly over it, each without its own part: alone in its bin, a fragment's
    exponent is exact but for the steps in which shares are kept.

    Args:
        depth: float32 [n], ascending, n > 0.
        rgba: uint8 [n, 4].
        optical: D, of all fragments.
        front: float64 [B+1], scratch.
        out: float64 [n].
    """
    n, bins = len(depth), len(front) - 1
    units_in_front(depth, rgba, front)
    total = front[bins]
    for b in range(bins + 1):
        front[b] = optical * kept_share(front[b], total)
    nearest, extent = depth[0], depth[n - 1] - depth[0]
    for i in range(n):
        place = place_of(depth[np.uint64(i)], nearest, extent, bins)
        b = min(int(place), bins - 1)
        others = front[b + 1] - front[b] - OPTICAL[rgba[np.uint64(i), 3]]
        out[np.uint64(i)] = front[b] + max(others, 0.0) * (place - b)
