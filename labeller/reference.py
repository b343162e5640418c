"""The oracle: plain float64, one pixel at a time, as METHOD sections 2 and 3 are written. Slow on purpose."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from renderer.tile_range import pixel_ranges
from schemas.colour import decode_gamma2, linear_to_srgb
from schemas.fragments import FragmentDump
from schemas.tail import (
    BIN_LIMIT,
    DEFAULT_TAIL,
    DENSITY_G,
    LEAST_OTHERS,
    LEAST_SPREAD,
    MAX_EXPONENT,
    OPTICAL_UNIT,
    PLAIN_SHARE,
    ROOT_SHARE,
    TAILS,
    MetricName,
    Tail,
    TailKind,
    TailName,
)

Colour = NDArray[np.float64]


@dataclass(frozen=True)
class Pixel:
    """One pixel's list, decoded to the space in which it is composited.

    Attributes:
        colour: float64 [n, 3], front to back; linear RGB (or stored values, for metric `paper`).
        alpha: float64 [n].
        depth: float64 [n], metres.
        background: float64 [3], in the space of `colour`.
        nearest: Where its depth bins begin, metres, a float32 value.
        extent: From there to their end, a float32 value.
    """

    colour: NDArray[np.float64]
    alpha: NDArray[np.float64]
    depth: NDArray[np.float64]
    background: NDArray[np.float64]
    nearest: float
    extent: float

    @property
    def n(self) -> int:
        """Number of fragments."""
        return len(self.alpha)


def pixel_of(dump: FragmentDump, p: int, stored: bool = False) -> Pixel:
    """Pixel p of a dump, in linear RGB, or in stored values / 255 if `stored`."""
    part = slice(dump.offsets[p], dump.offsets[p + 1])
    rgba, background, ranges = dump.rgba[part], dump.background[p], pixel_ranges(dump)
    return Pixel(
        colour=rgba[:, :3] / 255.0 if stored else decode_gamma2(rgba[:, :3]),
        alpha=rgba[:, 3] / 255.0,
        depth=dump.depth[part].astype(np.float64),
        background=background / 255.0 if stored else decode_gamma2(background),
        nearest=float(ranges.nearest[p]),
        extent=float(ranges.extent[p]),
    )


def tail_weights(pixel: Pixel, tail: TailName, g: float = DENSITY_G) -> NDArray[np.float64]:
    """float64 [n], the weights with which colours enter the tail's mean; they do not depend on k."""
    row = TAILS[tail]
    if pixel.n == 0 or row.kind not in (TailKind.DENSITY, TailKind.BINNED):
        return pixel.alpha.copy()
    optical = -np.log(np.maximum(1.0 - pixel.alpha, 1e-3))
    if row.kind == TailKind.BINNED:
        exponent = binned_exponents(pixel, optical, row)
    else:
        extent = pixel.depth[-1] - pixel.depth[0]
        relative = (pixel.depth - pixel.depth[0]) / (extent if extent > 0.0 else 1.0)
        exponent = g * optical.sum() * relative
    return np.asarray(pixel.alpha * np.exp(-np.minimum(exponent, MAX_EXPONENT)), dtype=np.float64)


@dataclass(frozen=True)
class DepthBins:
    """Where a pixel's fragments lie among its depth bins, and what is kept of these (METHOD section 2).

    Bins are found in float32, as shaders do, so that both agree on the bin of every fragment, and count in whole units.

    Attributes:
        place: float32 [n], bin and position in it as one number.
        bin: int64 [n].
        front: float64 [B+1], share of the optical depth in front of each bin, and of all, as kept.
        mean: float64 [B], mean position of the optical depth in each bin, as kept; one half where it is not.
        units: The pixel's optical depth, as kept.
    """

    place: NDArray[np.float32]
    bin: NDArray[np.int64]
    front: NDArray[np.float64]
    mean: NDArray[np.float64]
    units: int


def depth_bins(pixel: Pixel, optical: NDArray[np.float64], tail: Tail) -> DepthBins:
    """The depth bins of a pixel.

    Args:
        pixel: Its list, n > 0.
        optical: float64 [n], `-ln(1 - a)`.
        tail: A row with bins.
    """
    one, nearest, extent = np.float32(1.0), np.float32(pixel.nearest), np.float32(pixel.extent)
    z = pixel.depth.astype(np.float32)
    x = np.clip((z - nearest) / extent, np.float32(0.0), one) if extent > 0.0 else np.zeros_like(z)
    place = (np.float32(PLAIN_SHARE) * x + np.float32(ROOT_SHARE) * np.sqrt(x)) * np.float32(tail.bins)
    bin_ = np.minimum(place.astype(np.int64), tail.bins - 1)
    units = [max(1, round(float(d) * OPTICAL_UNIT)) if d > 0.0 else 0 for d in optical]
    moved = [
        math.floor(np.float32(u) * (y - np.float32(b)) + np.float32(0.5))
        for u, y, b in zip(units, place, bin_, strict=True)
    ]
    filled = [min(sum(u for u, b in zip(units, bin_, strict=True) if b == own), BIN_LIMIT) for own in range(tail.bins)]
    moments = [min(sum(m for m, b in zip(moved, bin_, strict=True) if b == own), BIN_LIMIT) for own in range(tail.bins)]
    front = [sum(filled[:b]) for b in range(tail.bins + 1)]
    mean = np.full(tail.bins, 0.5)
    for b in range(tail.bins - 1):
        if tail.mean_levels:
            mean[b] = _kept(moments[b], filled[b], tail.mean_levels) if filled[b] else 0.0
    shares = [_kept(f, front[-1], tail.share_levels) if front[-1] else 0.0 for f in front]
    return DepthBins(place, bin_, np.array(shares), mean, front[-1])


def _kept(part: int, whole: int, levels: int) -> float:
    """What is kept of a share: the nearest of so many steps, at most 1."""
    return min((2 * levels * part + whole) // (2 * whole), levels) / levels


def binned_exponents(pixel: Pixel, optical: NDArray[np.float64], tail: Tail) -> NDArray[np.float64]:
    """Optical depth that lies in front of each fragment, as far as depth bins know it (METHOD section 2).

    Args:
        pixel: Its list, n > 0.
        optical: float64 [n], `-ln(1 - a)`.
        tail: A row with bins.

    Returns:
        float64 [n].
    """
    bins = depth_bins(pixel, optical, tail)
    total, exponents = bins.units / OPTICAL_UNIT, np.empty(pixel.n)
    for i, (place, b) in enumerate(zip(bins.place, bins.bin, strict=True)):
        s = float(place) - float(b)
        before, within = total * bins.front[b], total * (bins.front[b + 1] - bins.front[b])
        others = max(0.0, within - optical[i])
        middle = 0.5
        if others > LEAST_OTHERS:
            middle = min(max((within * bins.mean[b] - optical[i] * s) / others, 0.0), 1.0)
        half = max(min(middle, 1.0 - middle), LEAST_SPREAD)
        exponents[i] = before + others * min(max((s - (middle - half)) / (2.0 * half), 0.0), 1.0)
    return exponents


def composite(pixel: Pixel, k: int, tail: TailName = DEFAULT_TAIL, g: float = DENSITY_G) -> Colour:
    """Colour of a pixel with k core fragments, float64 [3], in the space of `pixel.colour`."""
    transmittance, core = 1.0, np.zeros(3)
    for i in range(k):
        core = core + transmittance * pixel.alpha[i] * pixel.colour[i]
        transmittance *= 1.0 - pixel.alpha[i]
    behind = slice(k, pixel.n)
    alpha, weight = pixel.alpha[behind], tail_weights(pixel, tail, g)[behind]
    if len(alpha) == 0 or weight.sum() == 0.0:
        return np.asarray(core + transmittance * pixel.background)
    mean = (weight[:, None] * pixel.colour[behind]).sum(axis=0) / weight.sum()
    if TAILS[tail].kind not in (TailKind.WEIGHTED_AVERAGE, TailKind.PAPER):
        through = float(np.prod(1.0 - alpha))
    else:
        through = float(max(1.0 - alpha.sum() / len(alpha), 0.0) ** len(alpha))
    opacity = 1.0 if TAILS[tail].kind == TailKind.PAPER else 1.0 - through
    return np.asarray(core + transmittance * (opacity * mean + through * pixel.background))


def exact(pixel: Pixel) -> Colour:
    """Colour with all fragments composited in order, float64 [3]."""
    return composite(pixel, pixel.n, "exact-coverage")


def curve(
    dump: FragmentDump, p: int, tail: TailName = DEFAULT_TAIL, g: float = DENSITY_G, metric: MetricName = "display"
) -> NDArray[np.float64]:
    """float64 [n+1], e_p(k): squared difference from the exact colour, summed over RGB."""
    pixel = pixel_of(dump, p, stored=metric == "paper")
    colours = np.array([composite(pixel, k, tail, g) for k in range(pixel.n)] + [exact(pixel)])
    encoded = linear_to_srgb(colours) if metric == "display" else colours
    return np.asarray(((encoded - encoded[-1]) ** 2).sum(axis=1))


def heap_removal(
    curves: Sequence[NDArray[np.float32]], budget: int, key: Literal["absolute", "increment"] = "absolute"
) -> list[int]:
    """Algorithm 1 of DHOIT, literally: take one fragment at a time from the pixel with the smallest key.

    As printed it leaves every occupied pixel one fragment, where the budget covers that; by increments it does not.

    Args:
        curves: Per pixel its errors float32 [n+1].
        budget: F; removal stops when no more than F fragments are left, or none can be removed.
        key: `absolute`: the error after the removal (as printed); `increment`: by how much it grows.

    Returns:
        k of each pixel. Ties go to the smaller pixel index.
    """
    k = [len(e) - 1 for e in curves]
    least = int(key == "absolute" and budget >= sum(n > 0 for n in k))

    def entry(p: int) -> tuple[float, int]:
        error = curves[p]
        after = error[k[p] - 1]
        return float(after if key == "absolute" else after - error[k[p]]), p

    heap = [entry(p) for p in range(len(curves)) if k[p] > least]
    heapq.heapify(heap)
    used = sum(k)
    while used > budget and heap:
        _, p = heapq.heappop(heap)
        k[p] -= 1
        used -= 1
        if k[p] > least:
            heapq.heappush(heap, entry(p))
    return k


def optimum(curves: Sequence[NDArray[np.float32]], budget: int) -> float:
    """Smallest sum of errors over all k with `0 <= k <= n` and `sum k <= F`, by dynamic programming.

    Args:
        curves: Error curve of each pixel, float32 [n + 1], for k = 0..n.
        budget: F, fragments.
    """
    best = np.full(budget + 1, math.inf)
    best[0] = 0.0
    for error in curves:
        spent = np.full(budget + 1, math.inf)
        for k in range(min(len(error) - 1, budget) + 1):
            spent[k:] = np.minimum(spent[k:], best[: budget + 1 - k] + float(error[k]))
        best = spent
    return float(best.min())
