"""Ranks of a frame as its own pass writes them, and the cuts that follow of them in numpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.allocation.cuts import events_of, solve_cuts
from renderer.allocation.gpu import FrameAllocation
from renderer.frame import Frame
from renderer.techniques import KBufferDeep


def ranks_and_counts(deep: KBufferDeep, frame: Frame) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """What a frame without budget predicts: uint8 [P, B] each, ranks of bins and fragments in them."""
    binned = deep._counted(frame)
    allocation = FrameAllocation(frame.ctx, frame.gpu.programs, binned, frame.pixels, 0)
    allocation.begin()
    counts = binned.counts()
    if counts.any():
        deep._predict_ranks(frame, binned, allocation)
    bins = binned.tail.bins
    ranks = np.ascontiguousarray(binned.read()[:, 3 * bins // 4 : bins]).view(np.uint8)
    return np.where(counts.any(axis=1)[:, None], ranks, 0), counts


def expected_k(deep: KBufferDeep, frame: Frame, fragments: int) -> NDArray[np.int32]:
    """int32 [P], k by the numpy form, given the ranks of the frame."""
    return solve_cuts(events_of(*ranks_and_counts(deep, frame)), fragments).k
