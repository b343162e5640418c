"""Slow twins in extended precision or exact arithmetic: what is compared with where float64 itself is in question."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from labeller.reference import Pixel, binned_exponents, depth_bins, pixel_of
from renderer.features import FEATURES, SUMS
from schemas.bundle import FEATURE_LIMIT
from schemas.fragments import FragmentDump
from schemas.tail import (
    LUMA,
    LUMA_SHIFT,
    LUMA_SQUARE_SHIFT,
    MAX_EXPONENT,
    MOST_BINS,
    OPTICAL_UNIT,
    TAILS,
    TailKind,
    TailName,
)

Extended = NDArray[np.longdouble]


def extended_composite(pixel: Pixel, k: int, tail: TailName, g: float) -> Extended:
    """METHOD section 2 in the longest floating point that numpy has here (64 bits of mantissa on x86).

    Args:
        pixel: A list.
        k: Core fragments.
        tail: A name in `schemas.tail.TAILS`.
        g: Steepness of the density tail.

    Returns:
        Longdouble [3], in the space of the pixel's colours.
    """
    alpha, colour = pixel.alpha.astype(np.longdouble), pixel.colour.astype(np.longdouble)
    background = pixel.background.astype(np.longdouble)
    one = np.longdouble(1.0)
    through = np.concatenate([[one], np.cumprod(one - alpha)])
    core = ((through[:k] * alpha[:k])[:, None] * colour[:k]).sum(axis=0)
    behind, weight = alpha[k:], alpha[k:]
    if tail == "density" and pixel.n and pixel.depth[-1] > pixel.depth[0]:
        depth = pixel.depth.astype(np.longdouble)
        optical_depth = -np.log(np.maximum(one - alpha, np.longdouble(1e-3))).sum()
        relative = (depth[k:] - depth[0]) / (depth[-1] - depth[0])
        weight = behind * np.exp(-np.minimum(g * optical_depth * relative, MAX_EXPONENT))
    if TAILS[tail].kind == TailKind.BINNED and pixel.n:
        optical = -np.log(np.maximum(1.0 - pixel.alpha, 1e-3))
        exponent = binned_exponents(pixel, optical, TAILS[tail])[k:]
        weight = behind * np.exp(-np.minimum(exponent, MAX_EXPONENT))
    if len(behind) == 0 or weight.sum() == 0.0:
        return np.asarray(core + through[k] * background)
    mean = (weight[:, None] * colour[k:]).sum(axis=0) / weight.sum()
    if TAILS[tail].kind in (TailKind.WEIGHTED_AVERAGE, TailKind.PAPER):
        beyond = np.maximum(one - behind.sum() / len(behind), 0.0) ** len(behind)
    else:
        beyond = np.prod(one - behind)
    opacity = one if tail == "paper" else one - beyond
    return np.asarray(core + through[k] * (opacity * mean + beyond * background))


def exact_transmittance(level: int, n: int) -> Fraction:
    """`(1 - level / 255)^n`, exactly."""
    return Fraction(255 - level, 255) ** n


def exact_hull(error: NDArray[np.float32]) -> list[Fraction]:
    """The lower convex hull of a curve at every k, exactly, until the error first is 0.

    Args:
        error: float32 [n+1], `e(k)`, 0 at n.
    """
    values = [Fraction(float(e)) for e in error]
    end = next(k for k in range(len(values)) if values[k] == 0)
    hull, here = [values[0]], 0
    while here < end:
        # The steepest way down; of equal ones the longest.
        ahead = min(range(here + 1, end + 1), key=lambda k: ((values[k] - values[here]) / (k - here), -k))
        step = (values[ahead] - values[here]) / (ahead - here)
        hull += [values[here] + step * i for i in range(1, ahead - here + 1)]
        here = ahead
    return hull


def sums64(dump: FragmentDump, tail: TailName) -> NDArray[np.float64]:
    """The raw sums of every pixel, each as its definition reads.

    Args:
        dump: Fragments of a view.
        tail: A tail with bins.

    Returns:
        float64 [P, 4 TEXELS], columns `renderer.features.SUMS`.
    """
    out = np.zeros((dump.pixels, len(SUMS)))
    for p in np.flatnonzero(dump.counts).tolist():
        for name, value in _sums_of(pixel_of(dump, p, stored=True), tail).items():
            out[p, SUMS.index(name)] = value
    return out


def _sums_of(pixel: Pixel, tail: TailName) -> dict[str, float]:
    """Name -> value of one pixel's sums, those that are 0 left out.

    Args:
        pixel: Its list, stored colours / 255, n > 0.
        tail: A tail with bins.
    """
    row, light = TAILS[tail], -np.log(np.maximum(1.0 - pixel.alpha, 1e-3))
    kept = depth_bins(pixel, light, row)
    first, second = _luma_sums(pixel, light)
    found = {
        "n": float(pixel.n),
        "optical_depth": kept.units / OPTICAL_UNIT,
        "z_near": pixel.nearest,
        "z_far": pixel.nearest + pixel.extent,
        "sum_luma": 2**LUMA_SHIFT * first / 255.0 / OPTICAL_UNIT,
        "sum_luma2": 2**LUMA_SQUARE_SHIFT * second / 255.0**2 / OPTICAL_UNIT,
    }
    for i, c in enumerate("rgb"):
        found[f"background_{c}"] = float(pixel.background[i])
    for b in range(1, row.bins):
        found[f"front_{b}"] = float(kept.front[b])
        if row.mean_levels:
            found[f"mean_{b}"] = float(kept.mean[b - 1])
    return found


def _luma_sums(pixel: Pixel, light: NDArray[np.float64]) -> tuple[int, int]:
    """Of a list, in plain Python: whole units times luma, and times its square, as 16 bits hold them."""
    first = second = 0
    for colour, own in zip(np.rint(255.0 * pixel.colour).astype(int).tolist(), light.tolist(), strict=True):
        units = max(1, round(own * OPTICAL_UNIT)) if own > 0.0 else 0
        luma = (sum(weight * c for weight, c in zip(LUMA, colour, strict=True)) + 128) // 256
        first += math.floor(units * luma / 2**LUMA_SHIFT + 0.5)
        second += math.floor(units * luma**2 / 2**LUMA_SQUARE_SHIFT + 0.5)
    return min(first, 65535), min(second, 65535)


def features64(sums: NDArray[np.floating]) -> NDArray[np.float64]:
    """Features of raw sums in float64, [P, F], columns `renderer.features.FEATURES`; zero where n = 0.

    Written by hand from what the features are, not from `FORMULAS`.

    Args:
        sums: [P, S], raw sums of pixels, columns `renderer.features.SUMS`.
    """
    s = {name: sums[:, i].astype(np.float64) for i, name in enumerate(SUMS)}
    used = s["n"] > 0.5
    light = np.where(used, s["optical_depth"], 1.0)
    luma = s["sum_luma"] / light
    columns = {
        "log_n": np.log2(np.where(used, s["n"], 1.0)),
        "optical_depth": np.log1p(s["optical_depth"]),
        "luma_mean": luma,
        "luma_std": np.sqrt(np.maximum(1e-3, s["sum_luma2"] / light - luma**2)),
        "depth_extent": np.log(1e-4 + (s["z_far"] - s["z_near"]) / np.maximum(1e-30, s["z_far"])),
    }
    columns |= {f"background_{c}": s[f"background_{c}"] for c in "rgb"}
    columns |= {f"{kept}_{b}": s[f"{kept}_{b}"] for kept in ("front", "mean") for b in range(1, MOST_BINS)}
    return np.where(used[:, None], np.stack([columns[name] for name in FEATURES], axis=1), 0.0)


def network64(
    mean: NDArray[np.float32],
    std: NDArray[np.float32],
    layers: Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]],
    features: NDArray[np.floating],
) -> NDArray[np.float64]:
    """A network of the head `bin-gains` in float64.

    Args:
        mean: [F], of the inputs.
        std: [F].
        layers: Weight [out, in] and bias [out] of each.
        features: [R, F], in the order of the network's inputs.

    Returns:
        float64 [R, B+1], what it adds to the prior of each bin, and how much that counts.
    """
    x = (features.astype(np.float64) - mean.astype(np.float64)) / std.astype(np.float64)
    x = np.clip(x, -FEATURE_LIMIT, FEATURE_LIMIT)
    for weight, bias in layers[:-1]:
        x = np.maximum(x @ weight.astype(np.float64).T + bias.astype(np.float64), 0.0)
    weight, bias = layers[-1]
    out = x @ weight.astype(np.float64).T + bias.astype(np.float64)
    prior = np.maximum(out[:, -1:], 0.0) + np.log1p(np.exp(-np.abs(out[:, -1:])))
    return np.concatenate([out[:, :-1], prior], axis=1)
