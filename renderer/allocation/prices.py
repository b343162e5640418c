"""At which price each bin of a pixel becomes worth its fragments: what a network's answers mean (METHOD section 4).

A network of the head `bin-gains` answers, of every bin, how much its log gain is above what the tail tells by itself,
and how much that counts: `g_b = y_b + s P_b`. The log gain is that of each fragment of the bin, the bin's price `-g_b`,
and a bin is not worth less than those in front of it, which it cannot be in a core without.

What the tail tells of n fragments with an optical depth d together, behind D' of D: they show as much as they cover of
what is still seen, `2 log(1 - exp(-d)) - 2 D'`, which is shared by n; and a fragment alone in its bin is in the right
place but for the steps in which shares of D are kept.

Prices are kept as whole numbers, ranks of 8 bits: `PRICE_STEPS` a unit of log gain. All arithmetic is float32.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from renderer.features import FEATURES
from schemas.tail import OPTICAL_UNIT, Tail

RANKS: Final = 256
"""Of prices, as they are told apart."""
PRICE_STEPS: Final = 8.0
"""Ranks in a unit of log gain: gains of one rank differ by up to 13 %, which costs nothing (benchmarks/TRIALS.md)."""
LEAST_PRICE: Final = -4.0
"""Of rank 0: a squared error above 50 is none that a pixel can have."""
LEAST_PRIOR: Final = -40.0
LEAST_COVERED: Final = 1e-4
"""Of what a bin covers: below, its gain is told to be as if it did."""
LEAST_ALONE: Final = 1e-3
MOST_ALONE: Final = 0.5
"""What a fragment alone in its bin may be wrong by, as a share of its gain."""
LEAST_IMPORTANCE: Final = 2.0**-30

Floats = NDArray[np.float32]

_FRONT: Final = FEATURES.index("front_1")
_OPTICAL_DEPTH: Final = FEATURES.index("optical_depth")


def shares_of(kept: NDArray[np.uint16], tail: Tail) -> tuple[Floats, Floats]:
    """What is kept of packed bins (`shaders/common/kept_bins.glsl`), as numbers.

    Args:
        kept: uint16 [P, B].
        tail: Their tail.

    Returns:
        float32 [P, B+1], share of the optical depth in front of each bin, and 1; float32 [P], D.
    """
    front = np.zeros((len(kept), tail.bins + 1), dtype=np.float32)
    front[:, 1:-1] = (kept[:, :-1] >> 8).astype(np.float32) / np.float32(tail.share_levels)
    front[:, -1] = 1.0
    return front, kept[:, -1].astype(np.float32) / np.float32(OPTICAL_UNIT)


def prior_gains(front: Floats, optical_depth: Floats, counts: NDArray[np.integer], tail: Tail) -> Floats:
    """What the tail tells of each bin's log gain.

    Args:
        front: float32 [P, B+1], share of the optical depth in front of each bin, and 1.
        optical_depth: float32 [P], D.
        counts: [P, B], fragments of each bin.
        tail: The tail.

    Returns:
        float32 [P, B], `P_b >= LEAST_PRIOR`; that of an empty bin means nothing.
    """
    before = optical_depth[:, None] * front
    own = np.maximum(before[:, 1:] - before[:, :-1], np.float32(0.0))
    n = np.maximum(np.asarray(counts, dtype=np.float32), np.float32(1.0))
    covered = np.maximum(np.float32(1.0) - np.exp(-own), np.float32(LEAST_COVERED))
    step = np.clip(optical_depth * np.float32(0.5 / tail.share_levels), LEAST_ALONE, MOST_ALONE).astype(np.float32)
    gain = np.float32(2.0) * (np.log(covered) - before[:, :-1]) - np.log(n)
    gain += np.where(n == 1.0, np.float32(2.0) * np.log(step)[:, None], np.float32(0.0))
    return np.asarray(np.maximum(gain, np.float32(LEAST_PRIOR)), dtype=np.float32)


def feature_prior(features: Floats, counts: NDArray[np.integer], tail: Tail) -> Floats:
    """`prior_gains` of pixels whose features are known.

    Args:
        features: float32 [P, F], columns `renderer.features.FEATURES`.
        counts: [P, B], fragments of each bin.
        tail: The tail.
    """
    front = np.ones((len(features), tail.bins + 1), dtype=np.float32)
    front[:, 0] = 0.0
    front[:, 1:-1] = features[:, _FRONT : _FRONT + tail.bins - 1]
    return prior_gains(front, np.expm1(features[:, _OPTICAL_DEPTH]), counts, tail)


def gain_prices(answers: Floats, prior: Floats) -> Floats:
    """Prices of a network of the head `bin-gains`.

    Args:
        answers: float32 [P, B+1], `schemas.bundle.HEADS`.
        prior: float32 [P, B], from `prior_gains`.

    Returns:
        float32 [P, B]; NaN where a network overflows.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(-(answers[:, :-1] + answers[:, -1:] * prior), dtype=np.float32)


def importance_prices(importance: Floats, counts: NDArray[np.integer]) -> Floats:
    """Importances as prices: a bin comes at the scale t where `k = t w - .5` is the middle of its fragments.

    Eq. 3 of DHOIT with a scale in the place of its sum: `t w = k` and the nearest whole number. The price is `2 log t`.

    Args:
        importance: float32 [P], w, 0 to 1; NaN of a network that overflows counts as none.
        counts: [P, B], fragments of each bin.

    Returns:
        float32 [P, B].
    """
    after = np.cumsum(np.asarray(counts, dtype=np.float32), axis=1)
    middle = after - np.float32(0.5) * counts.astype(np.float32)
    weight = np.fmax(np.asarray(importance, dtype=np.float32), np.float32(LEAST_IMPORTANCE))
    scale = (middle + np.float32(0.5)) / weight[:, None]
    return np.asarray(np.float32(2.0) * np.log(scale), dtype=np.float32)


def ranks_of(prices: Floats, counts: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Ranks of bins, that of each at least those of the bins in front of it.

    NaN says nothing of a bin, so that it comes last.

    Args:
        prices: [P, B].
        counts: [P, B], fragments of each bin; an empty one has the rank of those in front of it.

    Returns:
        uint8 [P, B], rising along B.
    """
    with np.errstate(over="ignore"):
        steps = (np.asarray(prices, dtype=np.float32) - np.float32(LEAST_PRICE)) * np.float32(PRICE_STEPS)
    last = np.float32(RANKS - 1)
    ranks = np.floor(np.fmax(np.fmin(steps + np.float32(0.5), last), np.float32(0.0)))
    ranks = np.where(np.asarray(counts) > 0, np.where(np.isnan(steps), last, ranks), np.float32(0.0))
    return np.maximum.accumulate(ranks, axis=1).astype(np.uint8)
