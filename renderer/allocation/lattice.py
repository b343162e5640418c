"""The lambda of predicted gain curves on a lattice of prices: what `renderer/shaders/allocation` does, in numpy.

`solve_lambda` looks for `t = -log lambda` among all float64 numbers, which takes a search that a GPU would have to read
back. Here `t` is one of 2 LAST + 1 prices, close enough that few pixels grow between two of them, so that two rounds of
64 counts find it near the last frame's, and four from nothing. The answer is the greatest price within the budget,
whatever the search began with: no frame's picture depends on those before it. What is then left of the budget goes to
the pixels that grow at the next price, by index, each no further than its count there: `sum k = min(F, N)` to the
fragment, also where all pixels grow at once.

All arithmetic is float32, operation by operation, and every sum is of integers: the shaders give the same to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

EDGES: Final = 64
"""Prices that one round counts at."""
ROUNDS: Final = 5
"""Rounds in which any price is found from any start."""
SHIFT: Final = 9
"""Digits of float32 that prices do without. Around t = 10 they are 2^-11 apart."""
LAST: Final = 115 << (23 - SHIFT)
"""Index of the greatest price, 2^115: at the ends of the lattice every curve below gives n and 0."""
MOST_GAIN: Final = 2.0**100
LEAST_RATE: Final = 2.0**-98
MOST_RATE: Final = 2.0**12
"""Curves are clamped to these |a| and 1 / b; a trained network stays far within."""
MOST_FRAGMENTS: Final = 60_000
"""Fragments of one pixel that can have a slot (`renderer.screen.TURNS`)."""


@dataclass(frozen=True, slots=True)
class Curves:
    """Gain curves as the passes hold them: `log gain(k) = a - (k - 1) / rate`.

    Attributes:
        a: float32 [P].
        rate: float32 [P], 1 / b.
    """

    a: NDArray[np.float32]
    rate: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Solution:
    """Counts that meet a budget.

    Attributes:
        k: int32 [P], `sum k = min(F, sum n)`.
        index: Of the price; the next frame may start from it. None where nothing had to be solved.
        rounds: How many were needed.
    """

    k: NDArray[np.int32]
    index: int | None
    rounds: int


def within_limits(a: NDArray[np.floating], b: NDArray[np.floating]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """What a network answered, as numbers that a search can take.

    A network of finite weights can overflow, and answer infinity or, as a difference of such, NaN. NaN says nothing of
    a pixel, so that it comes last: the least gain, the fastest decay. `kbuffer-deep/curves.comp` has it so, too.

    Args:
        a: [P], log gain of the first fragment.
        b: [P], decay of the log gain per fragment, > 0 or NaN.

    Returns:
        float32 [P] each: |a| <= MOST_GAIN, 1 / MOST_RATE <= b <= 1 / LEAST_RATE.
    """
    with np.errstate(over="ignore"):
        gain, decay = np.asarray(a, dtype=np.float32), np.asarray(b, dtype=np.float32)
    # Of NaN and another number, fmin and fmax are the other.
    gain = np.fmin(np.fmax(gain, np.float32(-MOST_GAIN)), np.float32(MOST_GAIN))
    return gain, np.fmax(np.fmin(decay, np.float32(1.0 / LEAST_RATE)), np.float32(1.0 / MOST_RATE))


def curves_of(a: NDArray[np.floating], b: NDArray[np.floating]) -> Curves:
    """Gain curves within the limits of the search; arguments as `within_limits` has them."""
    gain, decay = within_limits(a, b)
    return Curves(gain, np.float32(1.0) / decay)


def importance_curves(importance: NDArray[np.floating]) -> Curves:
    """Importances as curves: `a = -1.5 / w` and `rate = w` give `k = floor(1.5 + (a + t) rate) = floor(t w)`.

    The price t is the scale that `budget_fill` looks for. The counts are its counts, but that the scale is one of the
    prices, at most t / 8192 apart from t = 1 on, and that the remainder goes by index to those that grow until the next
    one, not to the largest fractions. `kbuffer-deep/curves.comp` has it so, too.

    Args:
        importance: [P], 0 to 1, or NaN, of a network that overflows. NaN is none, as is what is below LEAST_RATE: such
            pixels share what is left evenly, once those above MOST_FRAGMENTS * LEAST_RATE (2e-25) are full.
    """
    rate: NDArray[np.float32] = np.fmax(np.asarray(importance, dtype=np.float32), np.float32(LEAST_RATE))
    rate = np.fmin(rate, np.float32(MOST_RATE))
    return Curves(np.float32(-1.5) / rate, rate)


def price(index: int) -> np.float32:
    """The t of an index from -LAST to LAST: does not fall with it, and is 0 at 0."""
    bits = np.array([0x3F800000 + (abs(index) << SHIFT)], dtype=np.uint32)
    magnitude = bits.view(np.float32)[0] - np.float32(1.0)
    return np.float32(-magnitude if index < 0 else magnitude)


def fragments_at(t: np.float32, curves: Curves, n: NDArray[np.integer]) -> NDArray[np.int64]:
    """`clamp(floor(1.5 + (a + t) rate), 0, n)`, int64 [P]; n is at most MOST_FRAGMENTS."""
    k = np.floor((curves.a + t) * curves.rate + np.float32(1.5))
    return np.asarray(np.clip(k, np.float32(0.0), np.asarray(n, dtype=np.float32)), dtype=np.int64)


def solve_on_lattice(curves: Curves, n: NDArray[np.integer], budget: int, start: int | None = None) -> Solution:
    """The counts of predicted gain curves at the one price that uses a budget.

    Args:
        curves: Of every pixel; those of pixels without fragments are not read.
        n: int [P], fragments of each pixel; what is above MOST_FRAGMENTS cannot have slots.
        budget: F, fragments to spend.
        start: `Solution.index` of an earlier frame; changes how long it takes, not what is found.
    """
    usable = np.minimum(np.asarray(n, dtype=np.int64), MOST_FRAGMENTS)
    if budget >= usable.sum():
        return Solution(usable.astype(np.int32), None, 0)
    opened = np.flatnonzero(usable)
    chosen = Curves(curves.a[opened], curves.rate[opened])
    low, high, rounds = _search(chosen, usable[opened], budget, start)
    k, growth = np.zeros_like(usable), np.zeros_like(usable)
    k[opened], most = (fragments_at(price(i), chosen, usable[opened]) for i in (low, high))
    growth[opened] = most - k[opened]
    before = np.cumsum(growth) - growth
    k += np.clip(budget - k.sum() - before, 0, growth)
    return Solution(k.astype(np.int32), low, rounds)


def _search(curves: Curves, n: NDArray[np.int64], budget: int, start: int | None) -> tuple[int, int, int]:
    """The greatest index whose counts are within the budget, the next one, and the rounds it took."""
    low, high = -LAST, LAST
    edges = _between(low, high)
    if start is not None:
        first = int(start / EDGES) * EDGES - EDGES * EDGES // 2
        edges = [min(max(first + EDGES * j, -LAST), LAST) for j in range(EDGES)]
    rounds = 0
    while high - low > 1:
        rounds += 1
        for edge in edges:
            if fragments_at(price(edge), curves, n).sum() > budget:
                high = edge
                break
            low = edge
        edges = _between(low, high)
    return low, high, rounds


def _between(low: int, high: int) -> list[int]:
    """The edges of a round, evenly spread between two indices."""
    apart = -(-(high - low) // (EDGES + 1))
    return [min(low + apart * (j + 1), high) for j in range(EDGES)]
