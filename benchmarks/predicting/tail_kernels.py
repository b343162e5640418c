"""Tails that were tried, compiled: what each takes for the optical depth in front of a fragment, and the errors.

A tail's weight is `a exp(-e)`, e its account of the optical depth in front; the mean colour by these weights is given
the exact opacity of all that lies behind the core, as with the density tails of METHOD section 2.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from renderer.depth_bins import OPTICAL
from renderer.techniques.moment import BIAS, OVERESTIMATION
from schemas.fragments import FragmentDump
from schemas.tail import MAX_EXPONENT

Offsets = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Depths = NDArray[np.float32]
Floats = NDArray[np.float64]

_SPREAD: Final = 0.375
"""Moments 2 and 4 towards which the bias of power moments goes (Muenstermann et al. 2018)."""
_LEAST_SPREAD: Final = 1e-30
_SMALL_MEAN: Final = 0.02
"""The mean depth of the others is kept this far from 0 and 1: beyond it the power would be extreme."""


@njit(parallel=True, cache=True, error_model="numpy")
def bin_exponents(
    offsets: Offsets, rgba: Bytes, depth: Depths, optical: Floats, bins: int, root: float, levels: int, out: Floats
) -> None:
    """Depth bins: `renderer.depth_bins` with any number of bins, of levels, and any places of the bins.

    Args:
        offsets: int64 [P+1].
        rgba: uint8 [N, 4].
        depth: float32 [N].
        optical: float64 [256].
        bins: B.
        root: Bins are equal in `(1 - root) x + root sqrt(x)`; 0: in x.
        levels: Steps in which shares are kept; 0: as they are.
        out: float64 [N].
    """
    root32, plain32 = np.float32(root), np.float32(1.0 - root)
    for p in prange(len(offsets) - 1):
        first, last = offsets[p], offsets[p + 1]
        if first == last:
            continue
        nearest = depth[first]
        extent = depth[last - 1] - nearest
        front = np.zeros(bins + 1)
        for i in range(first, last):
            x = (depth[i] - nearest) / extent if extent > np.float32(0.0) else np.float32(0.0)
            place = (plain32 * x + root32 * np.float32(math.sqrt(x))) * np.float32(bins)
            out[i] = place
            front[min(int(place), bins - 1) + 1] += optical[rgba[i, 3]]
        for j in range(bins):
            front[j + 1] += front[j]
        total = front[bins]
        if levels and total > 0.0:
            for j in range(bins + 1):
                front[j] = math.floor(levels * front[j] / total + 0.5) / levels * total
        for i in range(first, last):
            j = min(int(out[i]), bins - 1)
            others = max(front[j + 1] - front[j] - optical[rgba[i, 3]], 0.0)
            out[i] = front[j] + others * (out[i] - j)


@njit(parallel=True, cache=True, error_model="numpy")
def power_exponents(offsets: Offsets, rgba: Bytes, depth: Depths, optical: Floats, out: Floats) -> None:
    """Two numbers a pixel: D, and the mean depth of it. The share in front of x is `x^b`, b such that the mean fits."""
    for p in prange(len(offsets) - 1):
        first, last = offsets[p], offsets[p + 1]
        if first == last:
            continue
        extent = np.float64(depth[last - 1]) - depth[first]
        total, moment = 0.0, 0.0
        for i in range(first, last):
            x = (depth[i] - depth[first]) / extent if extent > 0.0 else 0.0
            total += optical[rgba[i, 3]]
            moment += optical[rgba[i, 3]] * x
        for i in range(first, last):
            own = optical[rgba[i, 3]]
            x = (depth[i] - depth[first]) / extent if extent > 0.0 else 0.0
            others = total - own
            mean = (moment - own * x) / others if others > 1e-9 else 0.5
            mean = min(max(mean, _SMALL_MEAN), 1.0 - _SMALL_MEAN)
            out[i] = others * x ** (mean / (1.0 - mean))


@njit(parallel=True, cache=True, error_model="numpy")
def moment_exponents(offsets: Offsets, rgba: Bytes, depth: Depths, optical: Floats, out: Floats) -> None:
    """Four power moments of the optical depth (Muenstermann et al. 2018), as `renderer.techniques.moment` has them.

    With central moments m_j of the biased measure and t = x - mean: `h_1 = m_2`, `P_2(y) = y^2 - y m_3 / m_2 - m_2`,
    `h_2 = m_4 - m_3^2 / m_2 - m_2^2`, `K(t, y) = 1 + t y / h_1 + P_2(t) P_2(y) / h_2`.
    """
    for p in prange(len(offsets) - 1):
        first, last = offsets[p], offsets[p + 1]
        if first == last:
            continue
        low = math.log(np.float64(depth[first]))
        extent = math.log(np.float64(depth[last - 1])) - low
        total, mean = 0.0, 0.0
        for i in range(first, last):
            x = 2.0 * (math.log(np.float64(depth[i])) - low) / extent - 1.0 if extent > 0.0 else -1.0
            out[i] = x
            total += optical[rgba[i, 3]]
            mean += optical[rgba[i, 3]] * x
        mean *= (1.0 - BIAS) / total
        square = mean * mean
        m2 = BIAS * (_SPREAD + square)
        m3 = -BIAS * mean * (3.0 * _SPREAD + square)
        m4 = BIAS * (_SPREAD + 6.0 * _SPREAD * square + square * square)
        for i in range(first, last):
            t, w = out[i] - mean, (1.0 - BIAS) * optical[rgba[i, 3]] / total
            m2 += w * t * t
            m3 += w * t * t * t
            m4 += w * t * t * t * t
        skew = m3 / m2
        h2 = max(m4 - m3 * skew - m2 * m2, _LEAST_SPREAD)
        least = np.inf
        for i in range(first, last):
            out[i] = total * _share_before(out[i] - mean, skew, m2, h2)
            least = min(least, out[i])
        for i in range(first, last):
            out[i] -= least  # the factor cancels, and weights do not vanish


@njit(inline="always")
def _share_before(t: float, skew: float, h1: float, h2: float) -> float:
    """Share of the mass in front of a point t of the distribution with these moments that has a point there."""
    q = (t * t - skew * t - h1) / h2
    mass = 1.0 / (1.0 + t * t / h1 + q * q * h2)
    b, c = t / h1 - q * skew, 1.0 - q * h1
    half = -0.5 * (b + math.copysign(math.sqrt(max(b * b - 4.0 * q * c, 0.0)), b))
    far = 1e6
    one = min(max(half / q if q != 0.0 else math.copysign(far, half), -far), far)
    two = min(max(c / half if half != 0.0 else far, -far), far)
    nearer, farther = min(one, two), max(one, two)
    if farther < t:
        before = 1.0 - mass
    elif nearer < t:
        y = (nearer * nearer - skew * nearer - h1) / h2
        before = 1.0 / (1.0 + nearer * nearer / h1 + y * y * h2)
    else:
        before = 0.0
    return before + OVERESTIMATION * mass


def errors_with(dump: FragmentDump, exponents: Floats) -> NDArray[np.float32]:
    """Squared error of every k, float32 [N+P], as `labeller.curves.Curves.error` has it, in display space.

    Args:
        dump: Fragments of a view.
        exponents: float64 [N], the tail's account of the optical depth in front of each fragment.
    """
    weights = dump.rgba[:, 3] / 255.0 * np.exp(-np.minimum(exponents, MAX_EXPONENT))
    error = np.empty(dump.total + dump.pixels, dtype=np.float32)
    decode = np.square(np.arange(256) / 255.0)
    _errors(dump.offsets, dump.rgba, dump.background, weights, decode, error)
    return error


def exponents_with(dump: FragmentDump, kernel: object, *constants: float) -> Floats:
    """What one of the kernels above gives, float64 [N]."""
    out = np.zeros(dump.total)
    assert callable(kernel)
    kernel(dump.offsets, dump.rgba, dump.depth, OPTICAL, *constants, out)
    return out


@njit(inline="always")
def _display(v: float) -> float:
    v = min(max(v, 0.0), 1.0)
    return 12.92 * v if v <= 0.0031308 else 1.055 * v ** (1.0 / 2.4) - 0.055


@njit(parallel=True, cache=True, error_model="numpy")
def _errors(
    offsets: Offsets, rgba: Bytes, background: Bytes, weights: Floats, decode: Floats, error: NDArray[np.float32]
) -> None:
    for p in prange(len(offsets) - 1):
        first, n = offsets[p], offsets[p + 1] - offsets[p]
        at = first + p
        error[at + n] = 0.0
        if n == 0:
            continue
        core, through = np.zeros((n + 1, 3)), np.ones(n + 1)
        for i in range(n):
            a = rgba[first + i, 3] / 255.0
            for c in range(3):
                core[i + 1, c] = core[i, c] + through[i] * a * decode[rgba[first + i, c]]
            through[i + 1] = through[i] * (1.0 - a)
        behind, weight, mean = 1.0, 0.0, np.zeros(3)
        for k in range(n - 1, -1, -1):
            w = weights[first + k]
            weight += w
            behind *= 1.0 - rgba[first + k, 3] / 255.0
            squared = 0.0
            for c in range(3):
                mean[c] += w * decode[rgba[first + k, c]]
                back = decode[background[p, c]]
                shown = core[k, c] + through[k] * ((1.0 - behind) * mean[c] / weight + behind * back)
                difference = _display(shown) - _display(core[n, c] + through[n] * back)
                squared += difference * difference
            error[at + k] = squared if squared >= 1e-24 else 0.0  # below: rounding of sums
