"""One pixel for every k: colours, errors and hull, by prefix sums over its list (METHOD sections 2 and 3).

For looking at single pixels where nothing is compiled: plain numpy, float64, O(n). `labeller.curves` is for views.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from labeller.reference import Pixel, tail_weights
from schemas.colour import linear_to_srgb
from schemas.tail import DENSITY_G, TAILS, MetricName, TailKind, TailName

_ROUNDING = 1e-24
"""Squared differences below this are the rounding of sums, as in `labeller.curve_kernels`."""


def transmittances(pixel: Pixel) -> NDArray[np.float64]:
    """float64 [n+1]: what passes the first k fragments."""
    return np.concatenate([np.ones(1), np.cumprod(1.0 - pixel.alpha)])


def colours(pixel: Pixel, tail: TailName, g: float = DENSITY_G) -> NDArray[np.float64]:
    """float64 [n+1, 3]: the pixel with k = 0..n core fragments, in the space of `pixel.colour`.

    Args:
        pixel: Its list.
        tail: One of `schemas.tail.TAILS`.
        g: Steepness of the density tail.
    """
    n, passes = pixel.n, transmittances(pixel)
    core = np.zeros((n + 1, 3))
    np.cumsum((passes[:-1] * pixel.alpha)[:, None] * pixel.colour, axis=0, out=core[1:])
    weight = tail_weights(pixel, tail, g)
    total, mean = _from_behind(weight), _from_behind(weight[:, None] * pixel.colour)
    mean /= np.where(total > 0.0, total, 1.0)[:, None]
    through = _behind(pixel, tail)
    opacity = np.where(total > 0.0, 1.0 if TAILS[tail].kind == TailKind.PAPER else 1.0 - through, 0.0)
    through = np.where(total > 0.0, through, 1.0)
    behind = opacity[:, None] * mean + through[:, None] * pixel.background
    return np.asarray(core + passes[:, None] * behind)


def errors(found: NDArray[np.float64], metric: MetricName = "display") -> NDArray[np.float32]:
    """float32 [n+1], `e_p(k)`: squared difference from the exact colour, summed over RGB.

    Args:
        found: Of `colours`, its last row the exact one.
        metric: As of `labeller.curves.error_curves`; for `paper` the colours are those of stored values.
    """
    encoded = linear_to_srgb(found) if metric == "display" else found
    squared = ((encoded - encoded[-1]) ** 2).sum(axis=1)
    return np.where(squared > _ROUNDING, squared, 0.0).astype(np.float32)


def hull(error: NDArray[np.float32]) -> list[int]:
    """Vertices k of the lower hull of a curve on 0..n, without its flat end; empty if the pixel cannot gain.

    Args:
        error: `e_p(k)`, float32 [n+1].
    """
    values = error.astype(np.float64).tolist()
    stack: list[int] = []
    if values[0] == 0.0:
        return stack
    for k in range(len(values)):
        while len(stack) >= 2:
            i, j = stack[-2:]
            if (values[i] - values[j]) * (k - j) > (values[j] - values[k]) * (j - i):
                break
            stack.pop()
        stack.append(k)
        if values[k] == 0.0:
            break
    return stack


def _behind(pixel: Pixel, tail: TailName) -> NDArray[np.float64]:
    """float64 [n+1]: what passes the tail behind the first k fragments."""
    if TAILS[tail].kind in (TailKind.WEIGHTED_AVERAGE, TailKind.PAPER):
        count = np.arange(pixel.n, -1, -1)
        mean = _from_behind(pixel.alpha) / np.maximum(count, 1)
        return np.asarray(np.maximum(1.0 - mean, 0.0) ** count)
    return np.concatenate([np.cumprod((1.0 - pixel.alpha)[::-1])[::-1], np.ones(1)])


def _from_behind(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums from each row on to the last, and 0: [n+1, ...]."""
    sums = np.zeros((len(values) + 1, *values.shape[1:]))
    sums[:-1] = np.cumsum(values[::-1], axis=0)[::-1]
    return sums
