"""Slow twins in extended precision or exact arithmetic: what is compared with where float64 itself is in question."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from labeller.reference import Pixel, binned_exponents, depth_bins
from renderer.depth_bins import MOST_BINS
from renderer.features import FEATURES, SUMS
from schemas.bundle import FEATURE_LIMIT, GAIN_FLOOR
from schemas.fragments import FragmentDump
from schemas.tail import DENSITY_BINS, MAX_EXPONENT, SHARE_LEVELS, TailName

Extended = NDArray[np.longdouble]


def extended_composite(pixel: Pixel, k: int, tail: TailName, g: float) -> Extended:
    """METHOD section 2 in the longest floating point that numpy has here (64 bits of mantissa on x86).

    Args:
        pixel: A list.
        k: Core fragments.
        tail: One of `schemas.tail.TAILS`.
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
    if tail in DENSITY_BINS and pixel.n:
        optical = -np.log(np.maximum(one - alpha, np.longdouble(1e-3)))
        exponent = binned_exponents(pixel.depth, optical, DENSITY_BINS[tail])[k:]
        weight = behind * np.exp(-np.minimum(exponent, MAX_EXPONENT))
    if len(behind) == 0 or weight.sum() == 0.0:
        return np.asarray(core + through[k] * background)
    mean = (weight[:, None] * colour[k:]).sum(axis=0) / weight.sum()
    if tail in ("density", "exact-coverage", *DENSITY_BINS):
        beyond = np.prod(one - behind)
    else:
        beyond = np.maximum(one - behind.sum() / len(behind), 0.0) ** len(behind)
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


def sums64(dump: FragmentDump, bins: int = 0) -> NDArray[np.float64]:
    """The raw sums of every pixel, each as its definition reads.

    Args:
        dump: Fragments of a view.
        bins: Depth bins of the tail; 0: it has none.

    Returns:
        float64 [P, 44], columns `renderer.features.SUMS`.
    """
    out = np.zeros((dump.pixels, len(SUMS)))
    for p in range(dump.pixels):
        part = slice(dump.offsets[p], dump.offsets[p + 1])
        if part.start == part.stop:
            continue
        depth, rgba = dump.depth[part].astype(np.float64), dump.rgba[part] / 255.0
        rgb, alpha = rgba[:, :3], rgba[:, 3]
        extent = depth[-1] - depth[0]
        x = (depth - depth[0]) / extent if extent > 0.0 else np.zeros(len(depth))
        columns = {
            "n": len(depth),
            "sum_a": alpha.sum(),
            "sum_a2": (alpha**2).sum(),
            "optical_depth": -np.log(np.maximum(1.0 - alpha, 1e-3)).sum(),
            "sum_x": x.sum(),
            "sum_x2": (x**2).sum(),
            "z_min": depth[0],
            "z_max": depth[-1],
            "nearest_a": alpha[0],
        }
        for i, c in enumerate("rgb"):
            columns |= {
                f"sum_{c}": rgb[:, i].sum(),
                f"sum_a_{c}": (alpha * rgb[:, i]).sum(),
                f"sum_{c}2": (rgb[:, i] ** 2).sum(),
                f"sum_{c}_x": (rgb[:, i] * x).sum(),
                f"nearest_{c}": rgb[0, i],
                f"background_{c}": dump.background[p, i] / 255.0,
            }
        if bins:
            optical = -np.log(np.maximum(1.0 - alpha, 1e-3))
            shares = depth_bins(depth, optical, bins)[1] / SHARE_LEVELS
            columns |= {f"front_{MOST_BINS // bins * b}": shares[b] for b in range(1, bins)}
        for name, value in columns.items():
            out[p, SUMS.index(name)] = value
    return out


def features64(sums: NDArray[np.floating]) -> NDArray[np.float64]:
    """Features of raw sums in float64, [P, 41], columns `renderer.features.FEATURES`; zero where n = 0."""
    s = {name: sums[:, i].astype(np.float64) for i, name in enumerate(SUMS)}
    used = s["n"] > 0.5
    n = np.where(used, s["n"], 1.0)

    def spread(squares: NDArray[np.float64], total: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sqrt(np.maximum(0.0, squares / n - (total / n) ** 2))

    with np.errstate(divide="ignore", invalid="ignore"):
        columns = {
            "log_n": np.log2(n),
            "optical_depth": np.log1p(s["optical_depth"]),
            "alpha_mean": s["sum_a"] / n,
            "alpha_std": spread(s["sum_a2"], s["sum_a"]),
            "alpha_nearest": s["nearest_a"],
            "depth_mean": s["sum_x"] / n,
            "depth_std": spread(s["sum_x2"], s["sum_x"]),
            "depth_extent": np.log(1e-4 + (s["z_max"] - s["z_min"]) / np.where(used, s["z_max"], 1.0)),
        }
        for c in "rgb":
            columns |= {
                f"rgb_mean_{c}": s[f"sum_{c}"] / n,
                f"rgb_alpha_{c}": s[f"sum_a_{c}"] / s["sum_a"],
                f"rgb_nearest_{c}": s[f"nearest_{c}"],
                f"background_{c}": s[f"background_{c}"],
                f"rgb_std_{c}": spread(s[f"sum_{c}2"], s[f"sum_{c}"]),
                f"rgb_depth_cov_{c}": s[f"sum_{c}_x"] / n - s[f"sum_{c}"] / n * s["sum_x"] / n,
            }
        columns |= {f"front_{j}": s[f"front_{j}"] for j in range(1, MOST_BINS)}
    return np.where(used[:, None], np.stack([columns[name] for name in FEATURES], axis=1), 0.0)


def network64(
    mean: NDArray[np.float32],
    std: NDArray[np.float32],
    layers: Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]],
    features: NDArray[np.floating],
) -> NDArray[np.float64]:
    """The gain-curve network in float64.

    Args:
        mean: [F], of the inputs.
        std: [F].
        layers: Weight [out, in] and bias [out] of each.
        features: [R, F], in the order of the network's inputs.

    Returns:
        float64 [R, 2], a and b.
    """
    x = (features.astype(np.float64) - mean.astype(np.float64)) / std.astype(np.float64)
    x = np.clip(x, -FEATURE_LIMIT, FEATURE_LIMIT)
    for weight, bias in layers[:-1]:
        x = np.maximum(x @ weight.astype(np.float64).T + bias.astype(np.float64), 0.0)
    weight, bias = layers[-1]
    out = x @ weight.astype(np.float64).T + bias.astype(np.float64)
    softplus = np.maximum(out[:, 1], 0.0) + np.log1p(np.exp(-np.abs(out[:, 1])))
    return np.stack([out[:, 0], softplus + GAIN_FLOOR], axis=1)
