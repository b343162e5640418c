"""What a frame of `kbuffer-deep` makes of a network's answers, on a stored view: whole bins within a budget."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.allocation.cuts import Events, events_of, solve_cuts
from renderer.allocation.prices import feature_prior, gain_prices, ranks_of
from renderer.depth_bins import bin_counts
from renderer.features import derive, gather
from schemas.fragments import FragmentDump
from schemas.tail import TAILS, TailName
from trainer.weights import Weights


def frame_events(dump: FragmentDump, tail: TailName, weights: Weights) -> tuple[NDArray[np.int64], Events]:
    """The occupied pixels of a view, and what they ask for at which price.

    Args:
        dump: Fragments of the view.
        tail: A tail with bins.
        weights: The network.
    """
    occupied = np.flatnonzero(dump.counts)
    counts = bin_counts(dump, tail)[occupied, : TAILS[tail].bins]
    features = derive(gather(dump, tail)[occupied])
    prices = gain_prices(weights.run(features), feature_prior(features, counts, TAILS[tail]))
    return occupied, events_of(ranks_of(prices, counts), counts)


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
