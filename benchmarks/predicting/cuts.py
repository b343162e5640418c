"""What a frame of `kbuffer-deep` makes of gain curves, on a stored view: whole bins within a budget."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer.allocation.cuts import Events, events_of, solve_cuts
from renderer.depth_bins import place_of
from renderer.tile_range import pixel_ranges
from schemas.fragments import FragmentDump
from schemas.tail import TAILS, TailName


def bin_counts(dump: FragmentDump, tail: TailName) -> NDArray[np.int64]:
    """Fragments of every pixel's depth bins, int64 [P, B].

    Args:
        dump: Fragments of a view.
        tail: A tail with bins.
    """
    ranges, bins = pixel_ranges(dump), TAILS[tail].bins
    counts = np.zeros((dump.pixels, bins), dtype=np.int64)
    _count(dump.offsets, dump.depth, ranges.nearest, ranges.extent, bins, counts)
    return counts


def frame_events(
    dump: FragmentDump, tail: TailName, a: NDArray[np.floating], b: NDArray[np.floating]
) -> tuple[NDArray[np.int64], Events]:
    """The occupied pixels of a view, and what they ask for at which price.

    Args:
        dump: Fragments of the view.
        tail: A tail with bins.
        a: [O], log gain of the first fragment of each occupied pixel.
        b: [O], its fall per fragment.
    """
    occupied = np.flatnonzero(dump.counts)
    return occupied, events_of(a, b, bin_counts(dump, tail)[occupied])


def core_of(dump: FragmentDump, occupied: NDArray[np.int64], events: Events, budget: int) -> NDArray[np.int32]:
    """Core fragments of every pixel, int32 [P].

    Args:
        dump: Fragments of the view.
        occupied: int64 [O], its pixels with fragments.
        events: Of those.
        budget: F.
    """
    k = np.zeros(dump.pixels, dtype=np.int32)
    k[occupied] = solve_cuts(events, budget).k
    return k


@njit(cache=True)
def _count(
    offsets: NDArray[np.int64],
    depth: NDArray[np.float32],
    nearest: NDArray[np.float32],
    extent: NDArray[np.float32],
    bins: int,
    counts: NDArray[np.int64],
) -> None:
    for p in range(len(offsets) - 1):
        for i in range(offsets[p], offsets[p + 1]):
            counts[p, min(int(place_of(depth[i], nearest[p], extent[p], bins)), bins - 1)] += 1
